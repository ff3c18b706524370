"""The proxy that is the surer the more returns there are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.perception.matching import found_objects
from care_sim.perception.proxy import GradedProxy, ReturnsRule, chance, count_hits, read_curves
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud
from care_sim.sources.street_films import street_film

LABELS = {4: 0, 9: 4}


def boxes_of(bodies):
    return np.array([[body, 0, 0, 1, 1, 1, 0] for body in bodies.tolist()], dtype=float).reshape(
        -1, 7
    )


def detect(hits, **rules):
    return ReturnsRule(LABELS, **rules).detections(np.array(hits, dtype=np.int64), boxes_of)


@pytest.mark.parametrize(("min_returns", "found"), [(1, [4, 9]), (2, [4, 9]), (3, [4]), (4, [])])
def test_the_threshold_is_exact(min_returns, found):
    _, bodies = detect([4, 9, 4, 9, 4, -1, -1, -1, -1], min_returns=min_returns)
    assert bodies.tolist() == found


def test_three_returns_by_default_with_class_true_box_and_count():
    detections, bodies = detect([9, 4, 9, 4, 9, 9])
    assert bodies.tolist() == [9]
    assert (detections.classes.tolist(), detections.returns.tolist()) == ([4], [4])
    assert detections.boxes.tolist() == boxes_of(np.array([9])).tolist()


def test_what_is_not_reported_is_not_detected():
    detections, bodies = detect([7] * 50 + [-1] * 50 + [0] * 50)
    assert len(detections) == len(bodies) == 0
    assert detections.boxes.shape == (0, 7)


@pytest.mark.parametrize("apart", [1, 3, 10**12])
def test_bodies_are_counted_however_far_their_numbers_lie_apart(apart):
    hits = np.random.default_rng(0).integers(-1, 9, 500) * apart
    bodies = np.array([0, 2, 3, 7]) * apart
    counts = count_hits(bodies, hits)
    assert counts.tolist() == [np.count_nonzero(hits == body) for body in bodies]


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


def curve_file(tmp_path, *lines):
    path = tmp_path / "recall.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("kind", "returns", "expected"),
    [
        # No returns are never detected, nor are fewer than the first row has.
        ("car", 0, 0.0),
        ("car", 1, 0.2),
        ("car", 2, 0.4),  # half of the way from 1 to 4, in the logarithm
        ("car", 4, 0.6),
        ("car", 400, 0.6),
        ("pedestrian", 7, 0.0),
        ("pedestrian", 8, 1.0),
        ("bus", 400, 0.0),
    ],
)
def test_a_file_sets_the_curves(tmp_path, kind, returns, expected):
    path = curve_file(tmp_path, "recall,class,returns", "0.2,car,1", "1,pedestrian,8", "0.6,car,4")
    present = crowd(4000, kind)
    detector = make_detector("graded", 1.84, file=str(path))
    _, objects = detector.detect(cloud(np.repeat(present.objects, returns)), present)
    assert len(objects) / len(present) == pytest.approx(expected, abs=0.03 * (0 < expected < 1))


def test_without_classes_a_curve_is_for_all(tmp_path):
    curves = read_curves(curve_file(tmp_path, "returns,recall", "1.5,0.25", "3,0.5"))
    assert curves == dict.fromkeys(CLASSES, ([1.5, 3.0], [0.25, 0.5]))


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        (["distance,recall", "5,0.2"], "recall.csv: must have one column returns, has distance, r"),
        (["returns,recall", "5,80"], r"recall of car must lie in \[0, 1\], got \[80.0\]"),
        (["returns,recall", "5,"], r"recall of car must lie in \[0, 1\], got \[nan\]"),
        (["returns,recall", "5,much"], "the column recall must hold numbers"),
        (["returns,recall", "0,0.2"], r"returns of car must ascend from 1 or more, got \[0.0\]"),
        (["returns,recall", "5,0.2", "5,0.3"], "must ascend from 1 or more"),
        (["returns,recall", ",0.2"], "must ascend from 1 or more"),
        (["returns,recall", "1,0.2", "inf,0.3"], r"must ascend from 1 or more, got \[1.0, inf\]"),
        (["returns,recall"], r"must ascend from 1 or more, got \[\]"),
        (["class,returns,recall", "Car,5,0.2"], "unknown class in .*recall.csv 'Car'; .*is car"),
        (["class,returns,recall", "5,0.2"], "no CSV table"),
    ],
)
def test_a_wrong_file_of_curves_is_named_in_one_line(tmp_path, lines, fault):
    with pytest.raises(InvalidInput, match=fault) as refused:
        make_detector("graded", 1.84, file=str(curve_file(tmp_path, *lines)))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("file", ["none.csv", 5])
def test_a_missing_file_of_curves_is_named(tmp_path, monkeypatch, file):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidInput, match=r"none\.csv: no CSV table|file must be"):
        make_detector("graded", 1.84, file=file)
