"""Pictures of beliefs made by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.belief import Belief
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks
from care_sim.policies.learned.grid_features import CHANNELS, GridFeatures
from care_sim.sensors.pictures import FRONT_CAMERA

RIG = Rig(cameras=(FRONT_CAMERA,), budget=492)
FEATURES = GridFeatures(RIG)
DRIVING = Ego(6.0, 0.1, -2.0)
CAR = [1, CLASSES.index("car"), 12.0, 0.0, -1.0, 4.6, 1.95, 1.7, 0.0, 0.0, 0.0, 0, 2]
PERSON = [CLASSES.index("pedestrian"), 0.9, 40, 90, 52, 120, 0, 0, 0]
SEEN_CAR = [CLASSES.index("car"), 0.9, 140, 80, 180, 130, 0, 0, 0]


def belief(tracks=(), detections=(), ranges=None, ego=DRIVING):
    scan = np.zeros((32, 512), np.float32) if ranges is None else ranges
    seen = ImageDetections.from_rows(np.array(detections, float).reshape(-1, 9))
    return Belief(
        ego, RIG.budget, seen, Tracks.from_rows(np.array(tracks, float).reshape(-1, 13)), scan
    )


def pictures(seen, features=FEATURES):
    return dict(zip(CHANNELS, features(seen)["grid"].reshape(features.shape), strict=True))


def pooled(cells):
    """The share of every block of 4 x 8 cells, the plain way."""
    mask = np.zeros(RIG.grid.size, bool)
    mask[cells] = True
    return mask.reshape(8, 4, 64, 8).mean((1, 3))


def scan(*returns):
    ranges = np.zeros((32, 512), np.float32)
    for row, column, distance in returns:
        ranges[row, column] = distance
    return ranges


def test_the_car_itself():
    assert FEATURES(belief())["ego"] == pytest.approx([0.2, 0.1, -0.2, 492 / 16384])


def test_hulls_and_wedges_are_shares_of_blocks():
    seen = belief([CAR], [PERSON, SEEN_CAR])
    unexplained, explained = camera_layers(seen, RIG)
    assert (len(unexplained), len(explained)) == (1, 1)
    drawn = pictures(seen)
    np.testing.assert_allclose(
        drawn["forecast"], pooled(RIG.hulls(seen.tracks.boxes)[0]), atol=1e-6
    )
    np.testing.assert_allclose(drawn["residual"], pooled(unexplained[0]), atol=1e-6)
    np.testing.assert_allclose(drawn["explained"], pooled(explained[0]), atol=1e-6)


def test_hulls_that_overlap_count_a_cell_once():
    np.testing.assert_array_equal(
        pictures(belief([CAR, CAR]))["forecast"], pictures(belief([CAR]))["forecast"]
    )


def test_the_nearest_return_of_a_block_and_the_share_fired():
    drawn = pictures(belief(ranges=scan((0, 0, 10.0), (3, 7, 20.0), (1, 1, 50.0), (0, 8, 50.0))))
    assert drawn["nearness"][0, 0] == pytest.approx(0.8)
    assert drawn["fired"][0, 0] == pytest.approx(3 / 32)
    assert (drawn["nearness"][0, 1], drawn["fired"][0, 1]) == (0, pytest.approx(1 / 32))
    assert np.count_nonzero(drawn["fired"]) == 2


@pytest.mark.parametrize(
    ("row", "distance", "stands"),
    [
        (8, 10.0, True),  # level: 1.84 m above the road
        (14, 13.2, False),  # 8 degrees down: 0 m
        (14, 10.0, True),  # 0.45 m
        (0, 20.0, False),  # 10.67 degrees up: 5.5 m
        (8, 50.0, False),  # nothing returned
    ],
)
def test_a_return_that_stands_off_the_road(row, distance, stands):
    drawn = pictures(belief(ranges=scan((row, 3, distance))))["undetected"]
    assert drawn[row // 4, 0] == (pytest.approx(1 / 32) if stands else 0)


def test_a_return_inside_a_forecast_is_no_surprise():
    ahead = scan((9, 256, 9.7))
    assert pictures(belief(ranges=ahead))["undetected"].sum() == pytest.approx(1 / 32)
    assert pictures(belief([CAR], ranges=ahead))["undetected"].sum() == 0


@given(st.integers(0, 2**32 - 1))
def test_every_value_stays_within_its_bounds(seed):
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(0, 50, (32, 512)).astype(np.float32) * (
        rng.random((32, 512)) < rng.random()
    )
    tracks = np.tile(CAR, (20, 1))
    tracks[:, 2:4] = rng.uniform(-60, 60, (20, 2))
    seen = belief(tracks, ranges=ranges.astype(np.float32), ego=Ego(*rng.uniform(-200, 200, 3)))
    drawn = FEATURES(seen)
    assert drawn["grid"].min() >= 0
    assert drawn["grid"].max() <= 1
    assert np.abs(drawn["ego"]).max() <= 1
