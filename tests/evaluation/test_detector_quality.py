"""The worth of a detector's boxes, worked by hand, and rules that hold of any reports."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.types import Detections
from care_sim.evaluation.detector_quality import (
    calibration_error,
    counts,
    curve,
    reliability,
    scene_boxes,
    score_of_precision,
)
from care_sim.evaluation.sightings import Sightings

SEEDS = st.integers(0, 2**32 - 1)


def scored(report, scores):
    return Detections(report.classes, report.boxes, report.returns, np.asarray(scores, float))


@pytest.fixture(scope="session")
def scene(shown, reported):
    """A car from the start, and a person from the second keyframe on; one of two boxes at the car
    is too many.
    """
    keyframes = [
        shown((1, "car", 10.0, 0.0)),
        shown((1, "car", 10.0, 0.0), (2, "pedestrian", 20.0, 3.0)),
    ]
    reports = [
        scored(reported(("car", 10.1, 0.0), ("car", 10.5, 0.0)), [0.9, 0.4]),
        scored(reported(("pedestrian", 20.0, 3.0), ("bus", 60.0, 0.0)), [0.6, 0.99]),
    ]
    return scene_boxes(Sightings.of("one", keyframes), reports)


def test_a_scene_by_hand(scene):
    # The bus is beyond 50 m: neither right nor wrong.
    assert scene.scores.tolist() == [0.9, 0.4, 0.6]
    assert scene.right.tolist() == [True, False, True]
    assert scene.found_at.tolist() == [0.9, -np.inf, 0.6]
    assert (scene.events.tolist(), scene.scans) == ([2], 2)
    points = curve([scene])
    assert points[-1] == pytest.approx([0.4, 2 / 3, 2 / 3])
    assert points[0] == pytest.approx([0.9, 1 / 3, 1.0])
    assert np.isnan(counts([scene], 0.95).precision)


@pytest.mark.parametrize(
    ("least", "precision", "recall", "first"),
    [(0.0, 2 / 3, 2 / 3, 1.0), (0.5, 1.0, 2 / 3, 1.0), (0.7, 1.0, 1 / 3, 0.0)],
)
def test_a_higher_score_leaves_fewer_boxes(scene, least, precision, recall, first):
    found = counts([scene, scene], least)
    assert found.precision == pytest.approx(precision)
    assert found.recall == pytest.approx(recall)
    assert found.first_recall == first


def test_one_class_alone(scene):
    car = counts([scene.of_class(0)])
    person = counts([scene.of_class(4)])
    assert (car.precision, car.recall, person.precision, person.first_recall) == (0.5, 0.5, 1, 1)
    assert car.events.sum() == 0


@pytest.mark.parametrize(("precision", "score"), [(0.5, 0.4), (0.7, 0.6), (1.0, 0.6)])
def test_the_least_score_of_a_precision(scene, precision, score):
    assert score_of_precision([scene], precision) == score


def test_equal_scores_count_together(shown, reported):
    keyframes = [shown((1, "car", 10.0, 0.0))]
    report = scored(reported(("car", 30.0, 0.0), ("car", 10.0, 0.0)), [0.5, 0.5])
    one = scene_boxes(Sightings.of("one", keyframes), [report])
    assert score_of_precision([one], 0.6) is None
    assert score_of_precision([one], 0.5) == 0.5


def test_scores_that_are_shares_have_no_error(shown, reported):
    keyframes = [shown((1, "car", 10.0, 0.0))]
    places = [("car", 10.0, 0.0), *[("car", 30.0, float(y)) for y in range(3)]]
    one = scene_boxes(Sightings.of("one", keyframes), [scored(reported(*places), [0.25] * 4)])
    assert calibration_error([one]) == 0
    assert reliability([one])[2].tolist() == [4, 0.25, 0.25]
    surer = scene_boxes(Sightings.of("one", keyframes), [scored(reported(*places), [0.75] * 4)])
    assert calibration_error([surer]) == pytest.approx(0.5)


@given(SEEDS)
def test_any_least_score_finds_what_a_detector_that_leaves_the_rest_out_does(
    street, detector, score_scene, seed
):
    shots = street(seed)
    rng = np.random.default_rng(seed)
    reports = [scored(one, rng.random(len(one)).round(1)) for one in detector(shots, seed)]
    sightings = Sightings.of("one", shots)
    every = scene_boxes(sightings, reports)
    for least in (0.0, 0.3, 0.75):
        kept = [one.take(one.scores >= least) for one in reports]
        found, alone = counts([every], least), score_scene(sightings, kept).tally()
        assert found.found.sum() == alone.found
        assert (found.sighted.sum(), found.events.sum()) == (alone.sighted, alone.events)
        assert found.right.sum() <= found.boxes.sum()
