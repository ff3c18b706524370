"""The class-consistent 2 m centre match on pairs whose answer is plain."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import turned
from care_sim.core.types import Detections
from care_sim.perception.matching import found_objects
from care_sim.sensors.annotated import Annotations


@pytest.mark.parametrize(("distance", "matches"), [(0.0, True), (1.99, True), (2.01, False)])
@pytest.mark.parametrize("towards", [(1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)])
def test_centres_match_up_to_two_metres(shown, reported, distance, matches, towards):
    detection = ("car", 8.0 + distance * towards[0], distance * towards[1])
    assert found_objects(shown((1, "car", 8.0, 0.0)), reported(detection)).tolist() == [matches]


def test_the_distance_is_planar(shown, reported):
    low = reported(("car", 10, 1))
    low.boxes[0, 2] += 3.0
    assert found_objects(shown((1, "car", 10, 0)), low).tolist() == [True]


def test_a_detection_of_another_class_finds_nothing(shown, reported):
    assert found_objects(
        shown((1, "pedestrian", 10, 0)), reported(("bicycle", 10, 0))
    ).tolist() == [False]


def test_scores_decide_who_chooses_first(shown, reported):
    """The better scored of the two takes the object that both are near; the other then has none."""
    row = shown((1, "car", 0, 0), (2, "car", 2, 0))
    assert found_objects(row, reported(("car", 1.1, 0, 0.9), ("car", 3.5, 0, 0.5))).tolist() == [
        False,
        True,
    ]
    assert found_objects(row, reported(("car", 1.1, 0, 0.5), ("car", 3.5, 0, 0.9))).tolist() == [
        True,
        True,
    ]


@pytest.mark.parametrize("scored", [(), (0.5,)])
def test_nothing_shown_or_nothing_reported(shown, reported, scored):
    assert found_objects(shown(), reported(("car", 1, 1, *scored))).tolist() == []
    assert found_objects(shown((1, "car", 1, 1)), reported()).tolist() == [False]
    assert found_objects(shown((1, "car", 1, 1)), reported(("car", 40, 1, *scored))).tolist() == [
        False
    ]


@pytest.mark.parametrize(
    ("boxes", "scores", "says"),
    [
        (np.zeros((2, 6)), None, r"2 detections must have boxes \(2, 7\).*got boxes \(2, 6\)"),
        (np.zeros((2, 7)), np.zeros(3), r"got boxes \(2, 7\), scores \(3,\)"),
        (np.full((2, 7), np.nan), None, "must be finite"),
        (np.zeros((2, 7)), np.array([0.5, np.nan]), "must be finite"),
    ],
)
def test_reports_that_do_not_fit_together_are_refused(shown, boxes, scores, says):
    with pytest.raises(InvalidInput, match=says):
        found_objects(
            shown(), Detections(np.zeros(2, np.int64), boxes, np.zeros(2, np.int64), scores)
        )


def crowd(seed, objects=4, detections=4):
    """Objects and detections of one class on a square of 5 m, so that several compete."""
    rng = np.random.default_rng(seed)
    boxes, reports = np.zeros((objects, 7)), np.zeros((detections, 7))
    boxes[:, :2], reports[:, :2] = (
        rng.uniform(0, 5, (objects, 2)),
        rng.uniform(0, 5, (detections, 2)),
    )
    zeros = np.zeros(max(objects, detections), np.int64)
    return Annotations(np.arange(objects), zeros[:objects], boxes), Detections(
        zeros[:detections], reports, zeros
    )


@given(st.integers(0, 2**32 - 1))
def test_the_assignment_is_the_best_of_all(seed):
    shown, reported = crowd(seed)
    distances = np.hypot(*(shown.boxes[:, None, :2] - reported.boxes[None, :, :2]).T).T
    choices = [
        [(n, d) for n, d in enumerate(order) if distances[n, d] <= 2]
        for order in permutations(range(4))
    ]
    best = min(choices, key=lambda pairs: (-len(pairs), sum(distances[pair] for pair in pairs)))
    assert np.flatnonzero(found_objects(shown, reported)).tolist() == [n for n, _ in best]


@given(
    st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi), st.permutations(range(5)), st.booleans()
)
def test_order_and_a_turn_of_the_sensor_do_not_matter(seed, yaw, order, scored):
    shown, reported = crowd(seed, objects=5)
    scores = np.random.default_rng(seed).random(4) if scored else None
    boxes = [np.c_[turned(b[:, :3], yaw), b[:, 3:]] for b in (shown.boxes, reported.boxes)]
    turned_shown = Annotations(shown.objects[order], shown.classes[order], boxes[0][order])
    before = found_objects(
        shown, Detections(reported.classes, reported.boxes, reported.returns, scores)
    )
    flipped = None if scores is None else scores[::-1]
    after = found_objects(
        turned_shown, Detections(reported.classes, boxes[1][::-1], reported.returns, flipped)
    )
    assert before[order].tolist() == after.tolist()
