import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS, Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks

GRID = AngularGrid()
STANDING = Ego()
values = st.floats(-1000, 1000, width=32)
classes = st.integers(0, len(CLASSES) - 1)
track_rows = st.lists(
    st.tuples(st.integers(0, 2**20), classes, *[values] * 9, *[st.integers(0, 100)] * 2), max_size=8
)
detection_rows = st.lists(
    st.tuples(classes, st.floats(0, 1, width=32), *[values] * 4, st.integers(0, 5), values, values),
    max_size=8,
)


def belief(tracks=(), detections=(), budget=1638, ego=STANDING, ranges=None):
    return Belief(
        ego,
        budget,
        ImageDetections.from_rows(
            np.array(detections, dtype=float).reshape(-1, len(ImageDetections.COLUMNS))
        ),
        Tracks.from_rows(np.array(tracks, dtype=float).reshape(-1, len(Tracks.COLUMNS))),
        np.zeros(GRID.shape, np.float32) if ranges is None else ranges,
    )


@given(
    track_rows, detection_rows, st.integers(1, GRID.size), st.builds(Ego, values, values, values)
)
def test_what_gymnasium_shows_reads_back_without_loss(tracks, detections, budget, ego):
    before = belief(tracks, detections, budget, ego)
    after = Belief.from_observation(before.to_observation())
    assert after.ego == before.ego
    assert after.budget == before.budget
    assert after.tracks.rows().tolist() == before.tracks.rows().tolist()
    assert after.detections.rows().tolist() == before.detections.rows().tolist()
    assert after.tracks.ids.dtype == after.detections.cameras.dtype == np.int64


def test_every_budget_survives_float32():
    blank = belief().to_observation()
    budgets = np.arange(1, GRID.size + 1)
    read = [
        Belief.from_observation({**blank, "budget": np.array([b / GRID.size], np.float32)}).budget
        for b in budgets.tolist()
    ]
    assert read == budgets.tolist()


def test_columns_keep_their_meaning():
    row = [3, 4, 10, 11, 12, 1, 2, 3, 0.5, -1, 1, 2, 6]
    tracks = belief([row]).tracks
    assert dict(zip(Tracks.COLUMNS, tracks.rows()[0].tolist(), strict=True)) == {
        "id": 3, "class": 4, "x": 10, "y": 11, "z": 12, "length": 1, "width": 2, "height": 3,
        "yaw": 0.5, "vx": -1, "vy": 1, "misses": 2, "hits": 6,
    }  # fmt: skip
    assert tracks.velocities.tolist() == [[-1, 1]]
    assert tracks.ranges[0] == pytest.approx(np.hypot(10, 11))
    detection = belief(detections=[[4, 0.5, 1, 2, 3, 4, 1, 0.1, 0.2]]).detections
    assert (
        detection.classes[0],
        detection.cameras[0],
        detection.ages[0],
        detection.yaw_changes[0],
    ) == (4, 1, 0.1, 0.2)
    assert detection.boxes.tolist() == [[1, 2, 3, 4]]


def test_padding_is_class_and_id_minus_one_and_float32():
    observation = belief([[5, 0, *range(9), 0, 1]], [[0, 1, *range(7)]]).to_observation()
    assert observation["tracks"].shape == (MAX_TRACKS, 13)
    assert observation["detections"].shape == (MAX_DETECTIONS, 9)
    assert set(observation["tracks"][1:, 0].tolist()) == {-1.0}
    assert set(observation["detections"][1:, 0].tolist()) == {-1.0}
    assert not observation["tracks"][1:, 1:].any()
    assert {array.dtype for array in observation.values()} == {np.dtype(np.float32)}


def test_tables_hold_what_they_can_and_refuse_more_in_one_line():
    tracks = [[n, 0, n, *[0] * 10] for n in range(MAX_TRACKS + 1)]
    detections = [[0, 1, n, *[0] * 6] for n in range(MAX_DETECTIONS + 1)]
    observation = belief(tracks[:-1], detections[:-1]).to_observation()
    read = Belief.from_observation(observation)
    assert observation["tracks"].shape == (MAX_TRACKS, 13)
    assert read.tracks.ids.tolist() == list(range(MAX_TRACKS))
    assert read.detections.boxes[:, 0].tolist() == list(range(MAX_DETECTIONS))
    with pytest.raises(InvalidInput, match="an observation holds 256 tracks at most, got 257"):
        belief(tracks).to_observation()
    with pytest.raises(InvalidInput, match="an observation holds 128 detections at most, got 129"):
        belief(detections=detections).to_observation()


@pytest.mark.parametrize("kind", [ImageDetections, Tracks])
def test_columns_read_off_rows_are_those_that_made_them(kind):
    rows = np.arange(3.0 * len(kind.COLUMNS)).reshape(3, -1)
    told = kind.from_checked_rows(rows.copy())
    again = replace(pickle.loads(pickle.dumps(told)))
    assert "boxes" not in vars(told)
    assert len(told) == len(again) == 3
    for field in fields(kind):
        one, other = getattr(told, field.name), getattr(again, field.name)
        assert one.dtype == other.dtype
        assert one.tolist() == other.tolist()
    assert told.boxes is told.boxes
    assert told.classes.dtype == np.int64
    assert again.rows().tolist() == rows.tolist()
    assert not hasattr(told, "colours")
    with pytest.raises(ValueError, match="read-only"):
        told.rows()[0] = 0.0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [ImageDetections, Tracks])
@pytest.mark.parametrize("number", [np.nan, np.inf, 1e30])
def test_rows_whose_whole_numbers_are_none_are_refused_in_one_line(kind, number):
    rows = np.ones((3, len(kind.COLUMNS)))
    rows[1, kind.COLUMNS.index("camera" if kind is ImageDetections else "hits")] = number
    with pytest.raises(InvalidInput, match="must be numbers up to 9"):
        kind.from_rows(rows)
    assert len(kind.from_rows(rows[:1])) == 1
