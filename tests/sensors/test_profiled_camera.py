"""The camera with a profile: its long run is the table, and no policy changes what it does."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import CAMERA_PROFILES, Sensing
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.envs.open_loop import FilmEnv
from care_sim.loops.film import Film
from care_sim.sensors.annotated import NO_OBJECT, IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.camera_errors import UNHIDDEN, whole_boxes
from care_sim.sensors.camera_profiles import PROFILES, YOLOX
from care_sim.sensors.false_boxes import BoxPool
from care_sim.sensors.pictures import FRONT_CAMERA

CAR, TRUCK, BICYCLE, PEDESTRIAN = (
    CLASSES.index(name) for name in ("car", "truck", "bicycle", "pedestrian")
)
OBJECTS = 300


def reported(label, distance, height, visible=1.0, keyframes=60, seed=0):
    """All that arrives of OBJECTS alike objects whose lower part is hidden."""
    box = np.array([[distance, 0.0, -1.84 + height / 2, 0.6, 0.6, height, 0.0]])
    ((left, top, right, bottom),) = whole_boxes(FRONT_CAMERA, box)
    row = [label, 0.9, left, top, right, top + visible * (bottom - top), 0, 0.0, 0.0]
    seen = IdentifiedDetections(
        ImageDetections.from_rows(np.tile(row, (OBJECTS, 1))), np.arange(OBJECTS)
    )
    camera = CameraDetector(
        range(OBJECTS),
        Sensing(camera_profile="yolox"),
        0.1,
        np.random.SeedSequence(seed),
        [FRONT_CAMERA],
    )
    boxes = np.repeat(box, OBJECTS, axis=0)
    found = [camera.detect(seen, 0.0, boxes, 0.1 * k) for k in range(keyframes)]
    return found, (bottom - top) * YOLOX.focal_px / FRONT_CAMERA.focal


@pytest.mark.parametrize("label", [CAR, PEDESTRIAN])
@pytest.mark.parametrize(("distance", "visible"), [(10.0, 1.0), (20.0, 1.0), (20.0, 0.45)])
def test_the_long_run_is_the_table(label, distance, visible):
    found, height = reported(label, distance, 1.8, visible)
    table = YOLOX.groups[YOLOX.group_of[label]].recall
    share = min(visible / UNHIDDEN[CLASSES[label]], 1.0)
    (recall,) = table.at(np.array([height]), np.array([share]))
    shares = [len(one) / OBJECTS for one in found]
    # From the first keyframe on, but for the spread of 300 objects.
    assert shares[0] == pytest.approx(recall, abs=0.1)
    assert np.mean(shares) == pytest.approx(recall, abs=0.03)


def test_misses_last_as_stated():
    found, _ = reported(PEDESTRIAN, 25.0, 1.8, keyframes=200)
    missed = np.array([~np.isin(np.arange(OBJECTS), one.objects) for one in found])
    away = missed - missed.mean()
    ratio = np.mean(away[1:] * away[:-1]) / np.mean(away**2)
    assert ratio == pytest.approx(np.exp(-0.1 / 0.22), abs=0.04)


def test_a_cyclist_is_sometimes_reported_as_a_pedestrian_and_stays_that_object():
    found, _ = reported(BICYCLE, 10.0, 1.8)
    classes = np.concatenate([one.detections.classes for one in found])
    assert {*classes.tolist()} == {BICYCLE, PEDESTRIAN}
    assert np.mean(classes == PEDESTRIAN) == pytest.approx(0.20, abs=0.04)
    assert not any((one.objects == NO_OBJECT).any() for one in found)


def test_boxes_lie_around_the_object_with_the_spread_of_the_profile():
    found, _ = reported(CAR, 15.0, 1.6)
    boxes = np.concatenate([one.detections.boxes for one in found])
    middles = (boxes[:, 0] + boxes[:, 2]) / 2
    widths = np.log(boxes[:, 2] - boxes[:, 0])
    width = np.exp(np.median(widths))
    assert np.std(middles) / width == pytest.approx(0.029, rel=0.2)
    assert np.std(widths) == pytest.approx(0.056, rel=0.2)


@pytest.mark.parametrize(("aside", "expected"), [(0.0, 0.0), (60.0, 0.28)])
def test_ghosts_come_as_often_as_stated_and_never_where_an_object_is(aside, expected):
    """All of the pool is one box, that of the car or one beside it."""
    box = np.array([[15.0, 0.0, -1.0, 1.8, 1.8, 1.6, 0.0]])
    (edges,) = whole_boxes(FRONT_CAMERA, box)
    times_s = 0.1 * np.arange(400)

    def seen(shift):
        row = [CAR, 0.9, *np.add(edges, [shift, 0.0, shift, 0.0]), 0, 0.0, 0.0]
        rows = np.array([row], float)
        return IdentifiedDetections(ImageDetections.from_rows(rows), np.array([0]))

    pool = BoxPool.of([seen(aside)] * len(times_s), times_s.tolist(), [FRONT_CAMERA])
    sensing = Sensing(camera_profile="yolox")
    counts = []
    for seed in range(30):
        camera = CameraDetector(
            [0], sensing, 0.1, np.random.SeedSequence(seed), [FRONT_CAMERA], pool
        )
        found = [camera.detect(seen(0.0), 0.0, box, 0.1 * k) for k in range(40)]
        counts += [np.sum(one.objects == NO_OBJECT) for one in found]
    # A second ghost at the same place is never shown beside the first.
    assert np.mean(np.array(counts) > 0) == pytest.approx(1 - np.exp(-expected), abs=0.05)


def observations(policy, keyframes=12, **conditions):
    env = gymnasium.make("CARE-Dense-v0", budget=0.05, disable_env_checker=True, **conditions)
    choose = care_sim.make_policy(policy, env)
    seen = [env.reset(seed=0)[0]]
    for _ in range(keyframes):
        seen.append(env.step(choose(seen[-1]))[0])
    env.close()
    return [one["detections"] for one in seen]


def test_every_policy_meets_the_same_detector():
    ours, theirs = (observations(policy, camera_profile="yolox") for policy in ("care", "random"))
    assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(ours, observations("care"), strict=True))


def test_the_faults_come_on_top_and_leave_the_profile_as_it_is():
    def boxes(**faults):
        return [
            {tuple(row[2:6]) for row in one if row[0] >= 0}
            for one in observations("random", camera_profile="yolox", **faults)
        ]

    alone, missing = boxes(), boxes(false_negative_rate=0.5)
    assert all(fewer <= all_ for fewer, all_ in zip(missing, alone, strict=True))
    assert sum(map(len, missing)) < sum(map(len, alone))


def test_every_profile_that_is_told_is_there():
    assert tuple(PROFILES) == CAMERA_PROFILES


def test_an_unknown_profile_is_refused_by_name():
    with pytest.raises(InvalidInput, match=r"camera_profile.*ideal.*yolox"):
        gymnasium.make("CARE-Dense-v0", camera_profile="yolo")


def test_detections_of_a_file_have_errors_of_their_own():
    film = Film("empty", (FRONT_CAMERA,), 1.84, 0.5, (), detected=True)
    env = FilmEnv(film, camera_profile="yolox")
    with pytest.raises(InvalidInput, match="camera_profile must be ideal where"):
        env.reset(seed=0)
