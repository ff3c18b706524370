"""Recalls and censored delays of scenes worked by hand, and what holds of any scene."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.types import Detections
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.sightings import Sightings

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="session")
def follow(shown, reported, score_scene):
    """Score a pedestrian that comes into sight: where it is at each keyframe, None for not
    annotated, and at which of them it is reported.
    """

    def make(distances, detected):
        keyframes = [shown() if x is None else shown((7, "pedestrian", x, 0.0)) for x in distances]
        reports = [
            reported(("pedestrian", 10.0 if x is None else x, 0.0)) if n in detected else reported()
            for n, x in enumerate(distances)
        ]
        return score_scene(Sightings.of("one", keyframes), reports)

    return make


LONG = [None, *[20] * 11]


@pytest.mark.parametrize(
    ("distances", "detected", "sighted", "delay", "chances"),
    [
        pytest.param(LONG, {1, 2}, True, 0, 6, id="found at its first keyframe"),
        pytest.param(LONG, {4}, False, 3, 6, id="found three keyframes later"),
        pytest.param(LONG, {6}, False, 5, 6, id="found at the last keyframe that counts"),
        pytest.param(LONG, {7}, False, 6, 6, id="found at K: censored"),
        pytest.param(LONG, set(), False, 6, 6, id="never found: censored"),
        pytest.param(
            [None, 20, 20], set(), False, 6, 2, id="the scene ends before K: censored all the same"
        ),
        pytest.param([None, 20, 20], {2}, False, 1, 2, id="the scene ends before K, found"),
        pytest.param(
            [None, 20, 60, 60, 60, 60, 60, 60],
            {2, 3},
            False,
            6,
            1,
            id="leaves by range, found out there",
        ),
        pytest.param(
            [None, 20, 60, 60, 30, 60, 60, 60],
            {4},
            False,
            3,
            2,
            id="leaves and returns in time, found",
        ),
        pytest.param(
            [None, 20, None, None, *[20] * 8],
            {2, 3},
            False,
            6,
            4,
            id="reported in an annotation gap",
        ),
        pytest.param(
            [60, 60, 40, 40],
            {0, 1, 2},
            True,
            0,
            2,
            id="found before it is in range, and at its entry",
        ),
        pytest.param([60, 60, 40, 40], {0, 1}, False, 6, 2, id="found before it is in range only"),
    ],
)
def test_the_delay_of_an_event(follow, distances, detected, sighted, delay, chances):
    result = follow(distances, detected)
    row = result.event_rows()[0]
    assert (row["detected"], row["ttfd"], row["chances"]) == (sighted, delay, chances)
    tally = result.tally()
    assert (tally.events, tally.sighted, tally.delay) == (1, sighted, delay)


def test_an_object_present_at_start_counts_in_overall_recall_alone(follow):
    found = follow([20, 20, 60, 20], {1, 2}).tally()
    assert found == Tally(events=0, sighted=0, delay=0, frames=3, found=1)
    # A return is an object frame, but no second event.
    found = follow([None, 20, 60, 20], {1}).tally()
    assert found == Tally(events=1, sighted=1, delay=0, frames=2, found=1)


def test_a_scene_of_several_objects_worked_by_hand(shown, reported, score_scene):
    """The parked car is there at start; a van enters by range, a child out of hiding, a cyclist
    behind, unseen.
    """
    car, van, child, rider = (
        (1, "car", 8.0, 3.0), (2, "truck", 49.0, 0.0),
        (3, "pedestrian", 12.0, -2.0), (4, "bicycle", -30.0, 0.5),
    )  # fmt: skip
    keyframes = [
        shown(car, (2, "truck", 55.0, 0.0)),
        shown(van, car, child),
        shown(rider, child, van, car),
    ]
    reports = [
        reported(("car", 8.0, 3.0), ("truck", 55.0, 0.0)),
        reported(("pedestrian", 12.0, -2.5), ("car", 8.0, 5.01)),
        reported(("truck", 49.0, 1.99), ("bicycle", -30.0, -1.51)),
    ]
    result = score_scene(Sightings.of("street", keyframes), reports)
    assert result.tally() == Tally(events=3, sighted=1, delay=1 + 0 + 6, frames=8, found=3)
    assert [
        (row["keyframe"], row["object"], row["class"], row["ttfd"]) for row in result.event_rows()
    ] == [
        (1, 2, "truck", 1),
        (1, 3, "pedestrian", 0),
        (2, 4, "bicycle", 6),
    ]
    assert result.event_rows()[2] == {
        "scene": "street", "keyframe": 2, "object": 4, "class": "bicycle",
        "range_m": np.hypot(30.0, 0.5), "azimuth": np.arctan2(0.5, -30.0),
        "detected": False, "ttfd": 6, "chances": 1,
    }  # fmt: skip


def test_an_event_counts_in_the_stratum_of_its_first_sighting(follow):
    """Seen first at 30 m and found at 10 m: the delay belongs to the far stratum, the found frame
    to the near one.
    """
    result = follow([None, 30, 10], {2})
    near = result.sightings.frames.ranges < 20
    assert result.tally(near) == Tally(events=0, sighted=0, delay=0, frames=1, found=1)
    assert result.tally(~near) == Tally(events=1, sighted=0, delay=1, frames=1, found=0)


def perfect(keyframes):
    return [Detections(a.classes, a.boxes, np.full(len(a), 3)) for a in keyframes]


@given(SEEDS)
def test_a_perfect_detector_finds_everything_at_once(street, score_scene, seed):
    keyframes = street(seed)
    tally = score_scene(Sightings.of("any", keyframes), perfect(keyframes)).tally()
    assert tally.sighted == tally.events
    assert tally.found == tally.frames
    assert tally.delay == 0


@given(SEEDS, SEEDS)
def test_counts_stay_within_what_there_is(street, detector, score_scene, seed, other):
    keyframes = street(seed)
    result = score_scene(Sightings.of("any", keyframes), detector(keyframes, other))
    tally = result.tally()
    assert 0 <= tally.sighted <= tally.events <= tally.frames
    assert tally.sighted <= tally.found <= tally.frames
    assert np.all((result.delays >= 0) & (result.delays <= 6))
    assert np.array_equal(result.delays == 0, result.found[result.sightings.events])
    assert np.all((result.chances >= 1) & (result.chances <= 6))
