"""Measured detectors over made keyframes: recall, luck, errors, and what they are given."""

import copy
import pickle

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.stack import GridStack
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.perception.matching import found_objects
from care_sim.perception.measured.recall import recall
from care_sim.perception.measured.tables import MEASURED, measurement
from care_sim.sensors.annotated import Annotations, Cloud
from care_sim.sensors.pictures import FRONT_CAMERA

MANY = 4000
WORTH_ONE = {"worth": 1.0, "false_boxes": False}


def rig(keyframe_s):
    return Rig(AngularGrid(), (FRONT_CAMERA,), 1638, keyframe_s=keyframe_s)


def begun(name, keyframe_s=0.5, is_filmed=True, seed=0, **parameters):
    detector = make_detector(name, 1.84, **parameters)
    return detector.begin(np.random.SeedSequence(seed), rig(keyframe_s), is_filmed)


def crowd(count=MANY, kind="car", seed=0):
    rng = np.random.default_rng(seed)
    places = rng.uniform(-40, 40, (count, 2))
    boxes = np.column_stack([places, np.tile([-1, 4.5, 1.9, 1.6, 0.3], (count, 1))])
    return Annotations(rng.permutation(count) + 5, np.full(count, CLASSES.index(kind)), boxes)


def cloud(objects, returns):
    hit = np.repeat(np.asarray(objects, np.int64), returns)
    return Cloud(np.zeros(len(hit), np.int64), np.empty((0, 3)), hit)


def share(detector, present, *returns):
    """The share that becomes tracks at the last of keyframes with so many returns on each."""
    for count in returns:
        report, _ = detector.detect(cloud(present.objects, count), present)
    return (report.scores >= detector.track_score).sum() / len(present)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        (name, kind)
        for name in MEASURED
        for kind, known in zip(CLASSES, measurement(name).recall.known, strict=True)
        if known
    ],
)
@pytest.mark.parametrize(("before", "now"), [(6, 6), (0, 6), (6, 1)])
def test_in_a_film_the_share_detected_is_that_of_the_formula(name, kind, before, now):
    scale = 20 if name == "pointrcnn" else 1
    expected = recall(name, kind, scale * now, scale * before)
    detector = begun(name, **WORTH_ONE)
    found = share(detector, crowd(kind=kind), 0, scale * before, scale * now)
    assert found == pytest.approx(expected[0], abs=0.03)


def test_who_was_away_for_a_keyframe_is_a_newcomer_again():
    detector, present = begun("centerpoint", **WORTH_ONE), crowd()
    share(detector, present, 6, 6)
    detector.detect(cloud([], 0), present.take(np.arange(0)))
    assert share(detector, present, 6) == pytest.approx(
        recall("centerpoint", "car", 6, 0)[0], abs=0.03
    )


@pytest.mark.parametrize("keyframes", [1, 4, 10, 15])
def test_in_the_closed_loop_the_last_ten_keyframes_count(keyframes):
    """A newcomer has a part of ten sweeps: its disadvantage follows."""
    detector = begun("centerpoint", 0.1, False, **WORTH_ONE)
    found = share(detector, crowd(), *[0] * 12, *[8] * keyframes)
    # As steady as an object with so many returns.
    assert found == pytest.approx(
        recall("centerpoint", "car", 0.8 * min(keyframes, 10))[0], abs=0.03
    )


def test_in_a_film_with_short_keyframes_sweeps_count_as_in_the_closed_loop():
    counts, present = [*[0] * 12, 8, 8, 8], crowd()
    short = share(begun("centerpoint", 0.1, first_hit=1.0, **WORTH_ONE), present, *counts)
    assert short == pytest.approx(recall("centerpoint", "car", 0.8 * 3)[0], abs=0.03)


@pytest.mark.parametrize("first_hit", [0.1, 1.0])
def test_what_a_first_hit_counts_is_a_parameter(first_hit):
    detector = begun("centerpoint", first_hit=first_hit, **WORTH_ONE)
    expected = recall("centerpoint", "car", 6 * first_hit)
    assert share(detector, crowd(), 0, 6) == pytest.approx(expected[0], abs=0.03)


def test_a_return_is_worth_what_its_solid_angle_says():
    usual = share(begun("megvii", false_boxes=False), crowd(), 4, 4)
    assert usual == pytest.approx(recall("megvii", "car", 4 * 1.25)[0], abs=0.03)
    dense = Rig(AngularGrid(columns=1024), (FRONT_CAMERA,), 1638, keyframe_s=0.5)
    made = make_detector("megvii", 1.84, false_boxes=False)
    found = share(made.begin(np.random.SeedSequence(0), dense, True), crowd(), 8, 8)
    assert found == pytest.approx(usual, abs=0.01)


def test_a_return_is_worth_what_the_solid_angle_of_its_own_lidar_says():
    usual, dense = AngularGrid(), AngularGrid(columns=512, rows=64)
    ratio = usual.row_height / dense.row_height
    both = Rig(
        GridStack((usual, dense), ((0, 0, 0), (1, 0, 0))), (FRONT_CAMERA,), 1638, keyframe_s=0.5
    )
    present = crowd()
    for first, counts, returns in (
        (0, (4, 4), 4),
        (usual.size, (8, 8), 8 / ratio),
    ):
        made = make_detector("centerpoint", 1.84, false_boxes=False)
        detector = made.begin(np.random.SeedSequence(0), both, True)
        for count in counts:
            hit = np.repeat(present.objects, count)
            cells = np.full(len(hit), first)
            report, _ = detector.detect(Cloud(cells, np.ones((len(hit), 3)), hit), present)
        found = (report.scores >= 0.5).sum() / MANY
        assert found == pytest.approx(recall("centerpoint", "car", 1.25 * returns)[0], abs=0.03)


@pytest.mark.parametrize("name", MEASURED)
def test_nothing_comes_from_nothing(name):
    for is_filmed in (False, True):
        report, objects = begun(name, is_filmed=is_filmed).detect(cloud([], 0), crowd())
        assert (len(report), len(objects)) == (0, 0)


def test_pointrcnn_reports_no_trucks_and_scores_from_0_to_1():
    assert share(begun("pointrcnn", **WORTH_ONE), crowd(kind="truck"), 500, 500) == 0
    detector = begun("pointrcnn", track_score=2.0, **WORTH_ONE)
    report, _ = detector.detect(cloud((present := crowd()).objects, 200), present)
    assert ((report.scores > 0.7) & (report.scores <= 1)).all()
    assert detector.track_score == pytest.approx(1 / (1 + np.exp(-2.0)))


def played(detector, present, returns):
    """By keyframe, the score and the box of every object that is reported."""
    told = []
    for counts in returns:
        hit = np.repeat(present.objects, counts)
        report, objects = detector.detect(
            Cloud(np.zeros(len(hit), np.int64), np.empty((0, 3)), hit), present
        )
        rows = zip(objects.tolist(), report.scores, report.boxes, strict=True)
        told.append({number: (score, *box) for number, score, box in rows})
    return told


def test_luck_depends_on_seed_object_and_time_alone():
    present = crowd(200)
    rng = np.random.default_rng(1)
    full = np.full((8, 200), 4)
    expected = played(begun("centerpoint", **WORTH_ONE), present, full)
    assert 20 < sum(map(len, expected)) / 8 < 200

    # Another policy fired at others before, and at the same objects from the seventh keyframe on.
    other = np.where(np.arange(8)[:, None] < 6, rng.integers(0, 9, full.shape), full)
    assert played(begun("centerpoint", **WORTH_ONE), present, other)[7] == expected[7]
    # In another order, and beside fewer others.
    order = rng.permutation(200)[:120]
    fewer = played(begun("centerpoint", **WORTH_ONE), present.take(order), full[:, :120])
    own = set(present.objects[order].tolist())
    assert fewer == [{n: row for n, row in one.items() if n in own} for one in expected]
    assert played(begun("centerpoint", seed=1, **WORTH_ONE), present, full) != expected


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_goes_on_as_the_original(copied):
    present, detector = crowd(100), begun("megvii", 0.1, False, false_boxes=False)
    detector.at(None, Frame(0, 0, 1.84, 0))
    played(detector, present, np.full((70, 100), 3))
    twin = copied(detector)
    rest = np.full((70, 100), 3)
    assert str(played(twin, present, rest)) == str(played(detector, present, rest))


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("kind", ["car", "pedestrian"])
def test_misses_last_as_measured(name, kind):
    """The correlation of the latent scores of two keyframes is stays + decays exp(-t / tau)."""
    measured = measurement(name)
    label = CLASSES.index(kind)
    returns = 100 if name == "pointrcnn" else 4
    detector = begun(name, measured.step_s, **WORTH_ONE)
    rows = played(detector, present := crowd(kind=kind), np.full((5, MANY), returns))
    score = measured.reported(np.array(measured.track_score))
    hits = np.array(
        [[one.get(n, (0.0,))[0] >= score for n in present.objects.tolist()] for one in rows]
    )
    margin = np.sqrt(2) * _erfinv(2 * hits.mean() - 1)
    luck = measured.luck
    for later in (1, 4):
        t = later * measured.step_s
        stays, decays, decay_s = (table[label, 0] for table in luck)
        expected = stays + decays * np.exp(-t / decay_s)
        if measured.flash_s:
            expected += (1 - stays - decays) * np.exp(-t / measured.flash_s)
        both = (hits[0] & hits[later]).mean()
        assert both == pytest.approx(_both_below(margin, expected), abs=0.025)


def _erfinv(value):
    from scipy.special import erfinv

    return erfinv(value)


def _both_below(margin, correlation):
    from scipy.stats import multivariate_normal

    return multivariate_normal(cov=[[1, correlation], [correlation, 1]]).cdf([margin, margin])


def centre_errors(present, *rows):
    """(k, n, 2) radial and tangential errors at the keyframes of `rows`, of objects in all."""
    kept = [n for n in rows[0] if all(n in row for row in rows)]
    true = dict(zip(present.objects.tolist(), present.boxes, strict=True))
    moved = np.array([[row[n][1:3] - true[n][:2] for n in kept] for row in rows])
    away = np.array([true[n][:2] / np.hypot(*true[n][:2]) for n in kept])
    across = np.column_stack([-away[:, 1], away[:, 0]])
    return np.stack([(moved * away).sum(axis=2), (moved * across).sum(axis=2)], axis=2)


def test_errors_of_boxes_are_those_of_the_table():
    present = crowd()
    (first,) = played(begun("centerpoint", **WORTH_ONE), present, np.ones((1, MANY), np.int64))
    errors = centre_errors(present, first)[0]
    assert np.median(np.abs(errors[:, 0])) == pytest.approx(0.187, abs=0.02)
    assert np.hypot(*errors.T).max() <= 2.0 + 1e-9
    true = dict(zip(present.objects.tolist(), present.boxes, strict=True))
    turned = np.abs(np.array([first[n][7] - true[n][6] for n in first])) > np.pi / 2
    assert turned.mean() == pytest.approx(0.072, abs=0.015)
    lower = np.array([first[n][3] - first[n][6] / 2 for n in first])
    assert lower == pytest.approx(present.boxes[0, 2] - present.boxes[0, 5] / 2)


@pytest.mark.parametrize(
    ("name", "lags", "radial", "tangential"),
    # Rank correlations of the centres of the same cars, as measured after so many keyframes.
    [
        ("centerpoint", (1, 2, 3, 6), (0.68, 0.60, 0.55, 0.41), (0.66, 0.51, 0.42, 0.15)),
        ("pointrcnn", (1, 5, 10, 20), (0.66, 0.51, 0.42, 0.36), (0.55, 0.35, 0.26, 0.21)),
    ],
)
def test_errors_last_as_measured_at_all_lags(name, lags, radial, tangential):
    detector = begun(name, measurement(name).step_s, **WORTH_ONE)
    rows = played(detector, present := crowd(2500), np.full((lags[-1] + 1, 2500), 300))
    for lag, *measured in zip(lags, radial, tangential, strict=True):
        errors = centre_errors(present, rows[0], rows[lag])
        ranks = np.argsort(np.argsort(errors, axis=1), axis=1)
        for part, expected in enumerate(measured):
            found = np.corrcoef(ranks[:, :, part])[0, 1]
            assert found == pytest.approx(expected, abs=0.06), (lag, part)


def test_errors_shrink_with_gathered_returns_and_do_not_jump_with_the_mask():
    detector, present = begun("centerpoint", 0.1, False, **WORTH_ONE), crowd()
    rows = played(detector, present, np.tile([[20], [1]], (6, MANY)))
    many, few = np.median(np.abs(centre_errors(present, *rows[-2:])[:, :, 0]), axis=1)
    assert few == pytest.approx(many, rel=0.05)
    assert few == pytest.approx(0.187 * 10.5**-0.189, rel=0.1)


def test_box_errors_can_be_switched_off():
    present = crowd(100)
    report, objects = begun("megvii", box_errors=False, **WORTH_ONE).detect(
        cloud(present.objects, 9), present
    )
    rows = [present.objects.tolist().index(number) for number in objects]
    assert report.boxes == pytest.approx(present.boxes[rows])


def test_what_is_reported_matches_its_own_object():
    """So the closed loop need not match places again."""
    present = crowd(300)
    far = present.boxes.copy()
    far[:, 0] = np.arange(300) * 10.0
    present = Annotations(present.objects, present.classes, far)
    report, objects = begun("megvii", **WORTH_ONE).detect(cloud(present.objects, 5), present)
    found = found_objects(present, report)
    assert set(present.objects[found].tolist()) == set(objects.tolist())


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"first_hit": 2}, r"first_hit must lie in \[0, 1\], got 2"),
        ({"worth": 0}, r"worth must lie in \[0.001, 1000\], got 0"),
        ({"track_score": 0.05}, r"track_score must lie in \[0.1, 0.95\], got 0.05"),
        ({"false_boxes": 1}, "false_boxes must be True or False, got 1"),
        ({"sweeps": 10}, "unknown parameter of detector centerpoint 'sweeps'; known: .*"),
    ],
)
def test_bad_parameters_are_named_in_one_line(parameters, line):
    with pytest.raises(InvalidInput, match=f"^{line}$"):
        make_detector("centerpoint", 1.84, **parameters)


def test_recall_names_what_it_does_not_know():
    for arguments, line in [
        (("yolo", "car", 1), "unknown measured detector 'yolo'; known: .*"),
        (("pointrcnn", "truck", 1), "unknown class of detector pointrcnn 'truck'; known: .*"),
        (("megvii", "pedestrian", 1, 1, 0.9), r"score of pedestrians of megvii must lie in .*"),
        (("megvii", "car", -1), "returns and previous must be numbers of 0 or more"),
    ]:
        with pytest.raises(InvalidInput, match=f"^{line}"):
            recall(*arguments)
