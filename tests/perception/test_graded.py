"""The proxy that is the surer the more returns there are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.perception.matching import found_objects
from care_sim.perception.proxy import CURVES, GradedProxy, chance
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud
from care_sim.sources.street_films import street_film


def crowd(count, kind="pedestrian", seed=0):
    rng = np.random.default_rng(seed)
    boxes = np.column_stack(
        [rng.uniform(-50, 50, (count, 2)), np.tile([-1, 0.7, 0.6, 1.8, 0], (count, 1))]
    )
    objects = rng.permutation(count) + 5
    return Annotations(objects, np.full(count, CLASSES.index(kind)), boxes)


def cloud(objects):
    return Cloud(
        np.arange(len(objects)), np.zeros((len(objects), 3)), np.asarray(objects, np.int64)
    )


@pytest.mark.parametrize("kind", CLASSES)
@pytest.mark.parametrize("returns", [2, 3, 8, 20, 200])
def test_the_share_detected_is_that_of_the_curve(kind, returns):
    present = crowd(4000, kind)
    detections, objects = GradedProxy().detect(cloud(np.repeat(present.objects, returns)), present)
    share = len(objects) / len(present)
    assert share == pytest.approx(chance(kind, np.array([returns]))[0], abs=0.03)
    assert (detections.returns == returns).all()


def test_what_is_detected_is_who_returned():
    present = crowd(300)
    hit = present.objects[::3]
    lost = np.full(50, NO_OBJECT)
    detections, objects = GradedProxy().detect(cloud([*np.repeat(hit, 30), *lost]), present)
    assert set(objects) <= set(hit)
    rows = [int(np.flatnonzero(present.objects == number)[0]) for number in objects]
    assert np.array_equal(detections.boxes, present.boxes[rows])


@given(st.integers(0, 50), st.integers(0, 60))
def test_more_returns_lose_nobody(few, more):
    present = crowd(40, seed=few)
    _, before = GradedProxy().detect(cloud(np.repeat(present.objects, few)), present)
    _, after = GradedProxy().detect(cloud(np.repeat(present.objects, few + more)), present)
    assert set(before) <= set(after)


def test_nobody_is_detected_where_nobody_is():
    detections, objects = GradedProxy().detect(cloud([]), crowd(0))
    assert len(detections) == len(objects) == 0


def test_neighbours_have_a_luck_of_their_own():
    present = crowd(1000)
    present.boxes[:, 0] = 10.0
    _, objects = GradedProxy().detect(cloud(np.repeat(present.objects, 3)), present)
    assert len(objects) / 1000 == pytest.approx(0.6, abs=0.06)


def test_the_curves_rise():
    for numbers, shares in CURVES.values():
        assert np.all(np.diff(numbers) > 0)
        assert np.all(np.diff(shares) >= 0)


def test_the_curves_are_those_of_the_cluster_detector():
    """On one street of the calibration; the curves are of twenty."""
    cluster = make_detector("cluster", 1.84)
    expected, found = {"people": [], "vehicles": []}, {"people": [], "vehicles": []}
    for seed in (1002,):
        for shot in street_film(seed).shots[::13]:
            report, _ = cluster.detect(shot.cloud, shot.annotations)
            matched = found_objects(shot.annotations, report)
            for row, number in enumerate(shot.annotations.objects):
                if np.hypot(*shot.annotations.boxes[row, :2]) > 50.0:
                    continue
                name = CLASSES[shot.annotations.classes[row]]
                group = "people" if name in ("bicycle", "pedestrian") else "vehicles"
                returns = np.array([(shot.cloud.objects == number).sum()])
                expected[group].append(chance(name, returns)[0])
                found[group].append(matched[row])
    for group, shares in expected.items():
        assert np.mean(found[group]) == pytest.approx(np.mean(shares), abs=0.1)
