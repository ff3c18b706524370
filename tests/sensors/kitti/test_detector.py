"""The camera of the profile `kitti`: what it reports of objects whose looks are known."""

from itertools import pairwise

import gymnasium
import numpy as np
import pytest
from scipy.stats import norm, rankdata

import care_sim
from care_sim.core.conditions import Sensing
from care_sim.core.pinhole import mounted_cameras
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.camera_errors import UNHIDDEN, whole_boxes
from care_sim.sensors.false_boxes import BoxPool
from care_sim.sensors.kitti import recall
from care_sim.sensors.kitti.background import usual_low
from care_sim.sensors.kitti.labels import labels_of, pictures_of
from care_sim.sensors.kitti.numbers import measured
from care_sim.sensors.pictures import FRONT_CAMERA
from tests.helpers.kitti_object import overlaps

FOCAL_PX = 721.5
SCALE = FOCAL_PX / FRONT_CAMERA.focal
CAR, TRUCK, BICYCLE, PEDESTRIAN = (
    CLASSES.index(name) for name in ("car", "truck", "bicycle", "pedestrian")
)
SIZES = {CAR: (4.2, 1.8, 1.55), TRUCK: (8.0, 2.5, 3.2), PEDESTRIAN: (0.5, 0.5, 1.75)}
SIZES[BICYCLE] = (1.8, 0.6, 1.75)


def box(label, distance, aside=0.0, turned=0.0):
    length, width, height = SIZES[label]
    return [distance, aside, -1.84 + height / 2, length, width, height, turned]


def seen_of(labels, boxes, shares=1.0, camera=FRONT_CAMERA, visible=None):
    """Faultless detections of whole boxes, of which the upper parts show."""
    edges = whole_boxes(camera, np.array(boxes))
    edges[:, 3] = edges[:, 1] + shares * (edges[:, 3] - edges[:, 1])
    rows = np.zeros((len(edges), len(ImageDetections.COLUMNS)))
    rows[:, ImageDetections.CLASS], rows[:, ImageDetections.CONFIDENCE] = labels, 0.9
    rows[:, ImageDetections.BOX] = edges
    return IdentifiedDetections(ImageDetections.from_rows(rows), np.arange(len(rows)), visible)


def labels_in(seen, boxes):
    rows, places = seen.detections.rows().copy(), np.arange(len(seen))
    visible = np.empty(0) if seen.visible is None else seen.visible
    return labels_of(rows, places, visible, boxes, mounted_cameras(1, [FRONT_CAMERA]), 0)


def camera_of(objects, seed=0, keyframe_s=0.1, cameras=(FRONT_CAMERA,)):
    sensing = Sensing(camera_profile="kitti", camera_confidence=0.0)
    seeds = np.random.SeedSequence(seed)
    return CameraDetector(range(objects), sensing, keyframe_s, seeds, list(cameras))


def alone(label, distance, keyframes=150, seeds=20, **looks):
    """Detections of an object that is alone, over the keyframes of cameras of many seeds."""
    boxes = np.array([box(label, distance)])
    seen = seen_of([label], boxes, **looks)
    for seed in range(seeds):
        camera = camera_of(1, seed)
        yield [camera.detect(seen, 0.0, boxes, 0.1 * k) for k in range(keyframes)]


@pytest.mark.parametrize(
    ("label", "distance", "visible"),
    [
        (CAR, 30.0, 1.0),
        (CAR, 45.0, 0.6),
        (PEDESTRIAN, 20.0, 0.9),
        (BICYCLE, 25.0, 0.9),
        (TRUCK, 50.0, 0.3),
    ],
)
def test_the_long_run_is_the_formula_at_every_confidence(label, distance, visible):
    level = {1.0: 0, 0.9: 0, 0.6: 1, 0.3: 2}[visible]
    (edges,) = whole_boxes(FRONT_CAMERA, np.array([box(label, distance)])) * SCALE
    width, height = edges[2] - edges[0], edges[3] - edges[1]
    if label in (BICYCLE, PEDESTRIAN):
        width *= UNHIDDEN[CLASSES[label]]
    scores = [
        one.detections.confidences[one.objects == 0].max(initial=0.0)
        for episode in alone(label, distance, visible=np.array([visible]))
        for one in episode
    ]
    away = np.hypot(*np.subtract((distance, 0.0), FRONT_CAMERA.position[:2]))
    for least in (0.1, 0.25, 0.5, 0.9):
        expected = recall(
            CLASSES[label], height, level, 0.0, away, width_px=width, confidence=least
        )
        assert np.mean(np.array(scores) >= least) == pytest.approx(expected, abs=0.05), least


def test_lengths_are_told_in_kittis_pixels_and_levels():
    """A pedestrian, a car whose left part is beyond the picture, and one behind another."""
    boxes = np.array(
        [box(PEDESTRIAN, 15.0), box(CAR, 4.0, 3.5), box(CAR, 20.0, -4.0), box(CAR, 26.0, -5.2)]
    )
    seen = seen_of([PEDESTRIAN, CAR, CAR, CAR], boxes, visible=np.array([0.84, 0.79, 0.46, 0.44]))
    told = labels_in(seen, boxes)
    spans = FRONT_CAMERA.project_boxes(boxes) * SCALE
    height = 1.75 / (15.0 - 0.25 - 0.76) * FOCAL_PX
    assert told.boxes[0, 3] - told.boxes[0, 1] == pytest.approx(height, rel=0.02)
    shown = np.subtract(*told.boxes[0, [2, 0]]) / np.subtract(*spans[0, [2, 0]])
    assert shown == pytest.approx(UNHIDDEN["pedestrian"])
    left, top, right, bottom = spans[1]
    inside = (right - 0.0) * (min(bottom, 180 * SCALE) - top) / ((right - left) * (bottom - top))
    assert told.beyond[1] == pytest.approx(1 - inside)
    assert told.cut[1].tolist() == [True, False, False, bottom > 180 * SCALE]
    assert told.levels.tolist() == [0, 1, 1, 2]
    low, high = np.maximum(spans[2, :2], spans[3, :2]), np.minimum(spans[2, 2:], spans[3, 2:])
    share = np.prod(high - low) / np.prod(spans[3, 2:] - spans[3, :2])
    assert told.cover == pytest.approx([0.0, 0.0, 0.0, share], abs=0.1)
    assert told.metres[2] == pytest.approx(np.hypot(20.0 - 0.76, 4.0))


def crowd(seed=0, lent=0.0, keyframes=40):
    """All that is reported of a row of people, cyclists and cars far apart."""
    labels = [PEDESTRIAN, CAR, BICYCLE, CAR, PEDESTRIAN, TRUCK]
    boxes = np.array([box(label, 22.0, 8.0 * (n - 2.5)) for n, label in enumerate(labels)])
    seen = seen_of(labels, boxes)
    pool = BoxPool.of([seen], [0.0], [FRONT_CAMERA])
    sensing = Sensing(camera_profile="kitti", camera_confidence=0.0, false_positive_rate=lent)
    seeds = np.random.SeedSequence(seed)
    camera = CameraDetector(range(6), sensing, 0.1, seeds, [FRONT_CAMERA], pool)
    return [camera.detect(seen, 0.0, boxes, 0.1 * k) for k in range(keyframes)]


@pytest.mark.parametrize("lent", [0.0, 3.0])
def test_all_boxes_true_and_false_end_on_whole_pixels_of_kitti(lent):
    reported = [crowd(seed, lent) for seed in range(6)]
    boxes, behind = (
        np.concatenate([getter(one) for episode in reported for one in episode])
        for getter in (lambda one: one.detections.boxes, lambda one: one.objects)
    )
    assert (behind == NO_OBJECT).sum() > 60
    assert (behind != NO_OBJECT).sum() > 600
    units = boxes * SCALE
    assert units == pytest.approx(np.rint(units), abs=1e-6)
    assert ((boxes >= 0) & (boxes <= [320, 180, 320, 180])).all()


def test_luck_lasts():
    """Scores of a car that stands still, as normal scores: correlated as stated."""
    scores = np.array(
        [
            [one.detections.confidences[one.objects == 0].max(initial=0.0) for one in episode]
            for episode in alone(CAR, 40.0, keyframes=40, seeds=80)
        ]
    )
    luck = norm.ppf((rankdata(scores) - 0.5) / scores.size).reshape(scores.shape)
    for lag in (1, 5, 20):
        correlation = np.mean(luck[:, lag:] * luck[:, :-lag])
        assert correlation == pytest.approx(0.76 * np.exp(-0.1 * lag / 1.29), abs=0.1)


def test_errors_of_boxes_last():
    """Lefts of a car that stands still: relative to the size, correlated as stated."""
    lefts = []
    for episode in alone(CAR, 15.0, keyframes=60, seeds=80):
        own = [one.detections.boxes[one.objects == 0, 0] for one in episode]
        lefts.append([left[0] if len(left) else np.nan for left in own])
    away = np.array(lefts) - np.nanmean(lefts)
    (edges,) = whole_boxes(FRONT_CAMERA, np.array([box(CAR, 15.0)]))
    assert 0.015 < np.nanstd(away) / (edges[2] - edges[0]) < 0.06
    for lag in (1, 5, 30):
        expected = 0.36 + 0.44 * np.exp(-0.1 * lag / 0.49)
        correlation = np.nanmean(away[:, lag:] * away[:, :-lag]) / np.nanvar(away)
        # Heavy tails are less correlated than the normal numbers behind them.
        assert expected - 0.2 < correlation < expected + 0.1


def of_nothing(keyframe_s, seeds=60, keyframes=40):
    """Rows of the false boxes of keyframes that show nothing, an episode per seed."""
    nothing = seen_of([], np.empty((0, 7)))
    for seed in range(seeds):
        camera = camera_of(1, seed, keyframe_s)
        seen = [camera.detect(nothing, 0.0, np.zeros((1, 7)), 0.0) for _ in range(keyframes)]
        yield [one.detections.rows() for one in seen]


def test_false_boxes_of_an_empty_scene_are_as_many_as_measured():
    # Keyframes so far apart that nothing lasts from one to the next.
    shown = [rows for episode in of_nothing(keyframe_s=3.0) for rows in episode]
    kinds = CAR, PEDESTRIAN, BICYCLE
    counts = np.array([[np.sum(rows[:, 0] == label) for label in kinds] for rows in shown])
    assert counts.mean(axis=0) == pytest.approx([0.084, 0.109, 0.055], abs=0.02)
    assert counts.var(axis=0) == pytest.approx([0.100, 0.181, 0.078], abs=0.04)


def test_false_boxes_last_as_long_as_measured_and_their_edges_change():
    stayed = same = there = 0
    for before, now in (pair for one in of_nothing(0.1, seeds=90) for pair in pairwise(one)):
        alike = before[:, 0][:, None] == now[:, 0]
        edges = before[:, ImageDetections.BOX], now[:, ImageDetections.BOX]
        stayed += ((overlaps(*edges)[0] >= 0.3) & alike).any(axis=1).sum()
        same += ((edges[0][:, None] == edges[1]).all(axis=2) & alike).sum()
        there += len(before)
    assert stayed / there == pytest.approx(np.exp(-0.1 / 0.36), abs=0.06)
    # None of the real detector's 75 false boxes repeats.
    assert same < 0.05 * stayed


def test_false_boxes_near_the_sides_of_the_picture_end_there_as_often_as_measured():
    """The real detector's 43 boxes that begin left of 20 pixels: 40%."""
    shown = [rows for episode in of_nothing(3.0, seeds=110) for rows in episode]
    lefts = np.concatenate(shown)[:, ImageDetections.LEFT] * SCALE
    near = lefts[lefts < 20]
    assert len(near) > 40
    assert np.mean(near == 0) == pytest.approx(0.4, abs=0.2)


def test_the_number_of_cameras_changes_no_false_box_beside_an_object():
    boxes = np.array([box(PEDESTRIAN, 12.0)])
    seen, (edges,) = seen_of([PEDESTRIAN], boxes), whole_boxes(FRONT_CAMERA, boxes)
    beside = []
    for count in (1, 3):
        camera = camera_of(1, cameras=[FRONT_CAMERA] * count)
        rows = [camera.detect(seen, 0.0, boxes, 0.1 * k).detections.rows() for k in range(200)]
        own = [one[one[:, ImageDetections.CAMERA] == 0] for one in rows]
        near = [overlaps(one[:, ImageDetections.BOX], edges[None])[0][:, 0] > 0.15 for one in own]
        beside.append(np.concatenate([one[those] for one, those in zip(own, near, strict=True)]))
    assert len(beside[0]) > 120
    assert np.array_equal(*beside)


def test_a_lower_camera_sees_objects_end_less_far_below_the_horizon():
    """A picture without cars has their mean place on KITTI's, where cameras are 1.65 m high."""
    (picture,) = pictures_of([FRONT_CAMERA])
    assert picture[4] == pytest.approx((1.84 - 0.33) / 1.65)
    boxes = np.array([box(CAR, 20.0)])
    labels = labels_in(seen_of([CAR], boxes), boxes)
    usual = measured().numbers.usual_lows[0]
    none = usual_low(labels, np.empty(0, np.int64), 0, picture, usual)
    assert none == pytest.approx(1.134 * 1.51 / 1.65, abs=0.01)
    # Heights of the car and of KITTI's differ.
    assert usual_low(labels, np.arange(1), 0, picture, usual) == pytest.approx(none, abs=0.1)


def test_false_boxes_beside_a_person_are_as_many_as_measured():
    """Beside an object that is found or not, at the rate of the fit."""
    others = [0, 0]
    keyframes = 0
    for episode in alone(PEDESTRIAN, 12.0):
        for one in episode:
            keyframes += 1
            false = one.detections.take(one.objects == NO_OBJECT)
            middle = false.boxes[:, [0, 2]].mean(axis=1)
            near = np.abs(middle - 160) < 12
            for n, label in enumerate((PEDESTRIAN, BICYCLE)):
                others[n] += np.sum(near & (false.classes == label))
    height = 1.75 / (12.0 - 1.01) * FOCAL_PX
    size = np.log(height / 50)
    rates = measured().numbers.pair_rates[1:3]
    expected = np.exp(rates[:, 0] + rates[:, 1] * size + rates[:, 2] * size**2)
    # Some are suppressed by the person's own box, and some lie farther aside.
    shares = np.array(others) / keyframes / expected
    assert ((shares > 0.6) & (shares < 1.15)).all(), shares


def test_luck_is_of_the_object_and_the_time_whatever_else_is_seen():
    boxes = np.array([box(PEDESTRIAN, 14.0, 6.0), box(CAR, 20.0, -8.0)])
    both, one = seen_of([PEDESTRIAN, CAR], boxes), seen_of([PEDESTRIAN], boxes[:1])
    ours, theirs = camera_of(2), camera_of(2)
    for k in range(60):
        first = ours.detect(both, 0.0, boxes, 0.1 * k)
        second = theirs.detect(one if k % 3 else both, 0.0, boxes, 0.1 * k)
        own = [each.detections.rows()[each.objects == 0] for each in (first, second)]
        assert np.array_equal(*own)


def observations(policy, keyframes=12, **conditions):
    env = gymnasium.make(
        "CARE-Dense-v0", budget=0.05, camera_profile="kitti", disable_env_checker=True, **conditions
    )
    choose = care_sim.make_policy(policy, env)
    seen = [env.reset(seed=0)[0]]
    for _ in range(keyframes):
        seen.append(env.step(choose(seen[-1]))[0])
    env.close()
    return [one["detections"] for one in seen]


def test_every_policy_meets_the_same_detector_again_and_again():
    first, again, others = (observations(policy) for policy in ("care", "care", "random"))
    assert np.array_equal(first, again)
    assert np.array_equal(first, others)
    assert not np.array_equal(first, observations("care", false_positive_rate=1.0))
