"""Faults of the camera one by one, with known rates and known delays."""

import itertools

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import ONE_WORLD
from care_sim.core.conditions import CameraFaults, Conditions, Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES
from care_sim.sensors.camera import CameraDetector, mounted, picture_timing
from care_sim.sensors.camera_faults import Delay, Detected, Misses
from care_sim.sensors.engines.picture_kernels import visible_boxes
from care_sim.sensors.pictures import (
    FRONT_CAMERA,
    FULL_CONFIDENCE,
    MIN_PIXELS,
    confidence_of,
    faultless_detections,
)
from care_sim.world.bodies import CATALOGUE

PEDESTRIAN = CLASSES.index("pedestrian")


class Detector(CameraDetector):
    """Everybody 20 m away, one picture a keyframe."""

    def __init__(self, labels, sensing, keyframe_s, seed):
        super().__init__(list(labels), sensing, keyframe_s, seed, [FRONT_CAMERA])
        self.labels = labels
        self.boxes = np.tile([20.0, 0, 0, 1, 1, 1, 0], (len(labels), 1))
        self.keyframe_s, self.frame = keyframe_s, -1

    def detect(self, picture, heading):
        self.frame += 1
        seen = faultless_detections([picture], self.labels)
        time_s = self.frame * self.keyframe_s
        return super().detect(seen, heading, self.boxes, time_s).detections


def detector(labels, keyframe_s=0.1, seed=0, **faults):
    return Detector(labels, Sensing(**faults), keyframe_s, np.random.SeedSequence(seed))


def picture(*boxes, shape=(180, 320)):
    """A picture of ids with rectangles (id, left, top, right, bottom), later ones in front."""
    ids = np.full(shape, -1)
    for body, left, top, right, bottom in boxes:
        ids[top:bottom, left:right] = body
    return visible_boxes(ids)


def test_boxes_are_the_outer_edges_of_the_visible_pixels():
    seen = picture((3, 10, 20, 30, 60), (7, 100, 0, 320, 180))
    assert seen.tolist() == [[3, 10, 20, 30, 60, 20 * 40], [7, 100, 0, 320, 180, 220 * 180]]


@pytest.mark.parametrize(("pixels", "visible"), [(MIN_PIXELS - 1, False), (MIN_PIXELS, True)])
def test_a_sliver_has_no_box(pixels, visible):
    seen = picture((3, 0, 0, pixels, 1))
    assert len(detector({3: 0}).detect(seen, 0.0)) == int(visible)


def test_only_bodies_with_a_label_are_detected_with_their_class():
    seen = picture((3, 50, 20, 80, 60), (7, 100, 20, 130, 60), (5, 0, 0, 30, 30))
    found = detector({7: 0, 5: PEDESTRIAN}).detect(seen, 0.0)
    assert found.classes.tolist() == [0, PEDESTRIAN]
    assert found.boxes.tolist() == [[100, 20, 130, 60], [0, 0, 30, 30]]
    assert found.cameras.tolist() == [0, 0]
    assert found.ages.tolist() == found.yaw_changes.tolist() == [0, 0]


def test_confidence_grows_with_the_visible_pixels_from_a_quarter():
    def confidence(pixels):
        return detector({3: 0}).detect(picture((3, 0, 0, pixels, 1)), 0.0).confidences[0]

    assert confidence(MIN_PIXELS) == pytest.approx(0.25)
    for pixels in (MIN_PIXELS, 13, 77, 319):
        assert confidence(pixels) == confidence_of(float(pixels))
    assert confidence(FULL_CONFIDENCE) == pytest.approx(0.5)
    assert confidence(300) > confidence(200)


LABELS = dict.fromkeys(range(1, 21), 0)
EVERYBODY = picture(*[(body, 15 * body, 0, 15 * body + 10, 10) for body in LABELS])


def missed(found, shown=LABELS):
    return {body for body in shown if 15 * body not in found.boxes[:, 0]}


def test_misses_do_not_depend_on_what_is_seen():
    """Two runs that see different bodies agree on each that both see: common random numbers."""
    few = [1, 4, 5, 11, 20]
    some = picture(*[(body, 15 * body, 0, 15 * body + 10, 10) for body in few])
    one, other = (detector(LABELS, false_negative_rate=0.5, seed=3) for _ in range(2))
    for frame in range(50):
        expected = missed(one.detect(EVERYBODY, 0.0)) & set(few)
        assert missed(other.detect(some if frame % 3 else EVERYBODY, 0.0), few) == expected


@pytest.mark.parametrize("latency", [0, 1, 2, 3])
def test_a_late_camera_shows_exactly_the_picture_of_then(latency):
    camera = detector({1: 0}, camera_latency=latency)
    found = [camera.detect(picture((1, 10 * t, 0, 10 * t + 9, 9)), 0.1 * t**2) for t in range(8)]
    assert [len(one) for one in found] == [0] * latency + [1] * (8 - latency)
    for t in range(latency, 8):
        assert found[t].boxes[0, 0] == 10 * (t - latency)
        assert found[t].ages[0] == pytest.approx(0.1 * latency)
        assert found[t].yaw_changes[0] == pytest.approx(0.1 * t**2 - 0.1 * (t - latency) ** 2)


def test_rendering_only_a_window_shows_the_same_bodies(bullet):
    """The body that is looked for lies whole in the window, with hidden and half-hidden parts as in
    the full picture.
    """
    places = {
        "car": (12, 3),
        "pedestrian": (9, -1),
        "bicycle": (14, 0.5),
        "bus": (40, 12),
        "truck": (1.5, 4),
        "van": (-9, 0),
    }
    looked_for = {
        bullet.add(CATALOGUE[name], (*place, 0.3)): (name, place) for name, place in places.items()
    }
    bullet.add(CATALOGUE["trailer"], (25.0, 4.0, 0.0))
    boxes = np.array(
        [[*at, CATALOGUE[n].size[2] / 2, *CATALOGUE[n].size, 0.3] for n, at in looked_for.values()]
    )
    sensor = Frame(0.0, 0.0, 1.84, 0.4)
    window = FRONT_CAMERA.window_on(sensor.boxes_to_local(boxes))
    whole, part = (
        bullet.body_ids(FRONT_CAMERA, sensor),
        bullet.body_ids(FRONT_CAMERA, sensor, window),
    )
    left, top, right, bottom = window
    assert part.shape == (bottom - top, right - left)
    for body in looked_for:
        before, after = (
            np.argwhere(whole == body),
            np.argwhere(part == body) + np.array([top, left]),
        )
        assert abs(len(before) - len(after)) <= 0.01 * len(before)
        if len(before):
            assert np.abs(before.min(axis=0) - after.min(axis=0)).max() <= 1
            assert np.abs(before.max(axis=0) - after.max(axis=0)).max() <= 1


NEAR, FAR = np.full(40, 10.0), np.full(40, 30.0)


def missed_by(frames, ranges=NEAR, seed=0, **faults):
    """(frames, objects) who was missed."""
    misses = Misses([CameraFaults(**faults)])
    misses.begin(0, np.random.SeedSequence(seed), len(ranges))
    return np.array([misses.draw(ONE_WORLD, ranges[None])[0] for _ in range(frames)])


def runs(missing):
    """Lengths of the bursts that begin and end within the frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    return [end - start for start, end in edges.reshape(-1, 2) if start > 0 and end < len(missing)]


@pytest.mark.parametrize("burst", [1, 3, 10])
@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_bursts_leave_the_share_of_misses_as_it_is_from_the_first_frame_on(rate, burst):
    shares = np.array(
        [
            missed_by(400, false_negative_rate=rate, false_negative_burst=burst, seed=s)
            for s in range(8)
        ]
    )
    assert shares.mean() == pytest.approx(rate, abs=0.02)
    first = np.array(
        [
            missed_by(1, false_negative_rate=rate, false_negative_burst=burst, seed=s)
            for s in range(100)
        ]
    )
    assert first.mean() == pytest.approx(rate, abs=0.03)


def test_a_burst_lasts_its_keyframes():
    table = missed_by(500, false_negative_rate=0.1, false_negative_burst=5)
    lengths = [length for column in table.T for length in runs(column)]
    assert len(lengths) > 100
    assert {length % 5 for length in lengths} == {0}


def test_misses_grow_with_the_distance_up_to_all():
    faults = {"false_negative_rate": 0.1, "false_negative_per_m": 0.02}
    assert missed_by(500, NEAR, **faults).mean() == pytest.approx(0.3, abs=0.02)
    assert missed_by(500, FAR, **faults).mean() == pytest.approx(0.7, abs=0.02)
    assert missed_by(20, np.full(5, 60.0), **faults).all()


def tagged(number):
    """One detection that says which picture it is of."""
    row = [0, 0.9, number, 0, number + 1, 1, 0, 0, 0]
    return Detected(np.array([1]), np.array([[row]], float), np.array([[number]]))


def delivered(latency, jitter, frames, seed=0):
    delay = Delay(np.array([latency]), np.array([jitter]), 0.1)
    delay.begin(0, np.random.SeedSequence(seed))
    handed_out = []
    for n in range(frames):
        heading = np.array([0.01 * n])
        delay.take(ONE_WORLD, tagged(n), heading)
        handed_out.append(delay.newest(ONE_WORLD, heading).take(0))
    assert all(seen.objects.tolist() == seen.detections.boxes[:, 0].tolist() for seen in handed_out)
    return [seen.detections for seen in handed_out]


def test_jitter_hands_out_the_newest_picture_that_has_arrived():
    frames = delivered(1, 3, 300)
    shown = [int(d.boxes[0, 0]) if len(d) else -1 for d in frames]
    ages = [now - then for now, then in enumerate(shown) if then >= 0]
    assert all(later >= sooner for sooner, later in itertools.pairwise(shown))
    assert (min(ages), max(ages)) == (1, 4)
    for now, detections in enumerate(frames):
        if len(detections):
            assert detections.ages[0] == pytest.approx(0.1 * (now - shown[now]))
            assert detections.yaw_changes[0] == pytest.approx(0.01 * (now - shown[now]))


def test_the_mount_errs_with_its_spread_and_not_at_all_by_default():
    assert mounted(FRONT_CAMERA, CameraFaults(), np.random.default_rng(0)) == FRONT_CAMERA
    faults = CameraFaults(camera_rotation_sigma_deg=2.0, camera_position_sigma_m=0.1)
    cameras = [mounted(FRONT_CAMERA, faults, np.random.default_rng(seed)) for seed in range(400)]
    assert np.rad2deg(np.std([c.yaw for c in cameras])) == pytest.approx(2.0, rel=0.15)
    assert np.rad2deg(np.std([c.pitch for c in cameras])) == pytest.approx(2.0, rel=0.15)
    shifts = np.array([c.position for c in cameras]) - FRONT_CAMERA.position
    assert shifts.std(axis=0) == pytest.approx(0.1, rel=0.15)


def observations(policy="care", keyframes=6, **conditions):
    env = gymnasium.make("CARE-Dense-v0", budget=0.05, disable_env_checker=True, **conditions)
    chooses = care_sim.make_policy(policy, env)
    seen = [env.reset(seed=0)[0]]
    for _ in range(keyframes):
        seen.append(env.step(chooses(seen[-1]))[0])
    env.close()
    return seen


def test_a_blackout_is_black_while_it_lasts():
    seen = [
        np.sum(o["detections"][:, 0] >= 0)
        for o in observations(blackout_start_s=0.2, blackout_s=0.2)
    ]
    assert [count > 0 for count in seen] == [True, True, False, False, True, True, True]


def test_the_confidence_threshold_keeps_what_is_sure():
    usual, sure = (
        observations()[0]["detections"],
        observations(camera_confidence=0.5)[0]["detections"],
    )
    kept = usual[usual[:, 1] >= 0.5]
    assert 0 < len(kept) < np.sum(usual[:, 0] >= 0)
    assert np.array_equal(sure[: len(kept)], kept)
    assert np.all(sure[len(kept) :, 0] == -1)


def test_with_the_camera_black_care_scans_as_history():
    dark = {"blackout_s": 10.0}
    ours, theirs = observations("care", 25, **dark), observations("history", 25, **dark)
    assert all(np.array_equal(a["ranges"], b["ranges"]) for a, b in zip(ours, theirs, strict=True))


def test_every_policy_meets_the_same_faults():
    faults = {
        "false_negative_rate": 0.3,
        "false_negative_burst": 3,
        "false_positive_rate": 2.0,
        "camera_jitter": 2,
    }
    ours, theirs = observations("care", 10, **faults), observations("random", 10, **faults)
    assert all(
        np.array_equal(a["detections"], b["detections"]) for a, b in zip(ours, theirs, strict=True)
    )
    assert any((a["detections"][:, 0] >= 0).any() for a in ours)


@pytest.mark.parametrize(
    ("fault", "named"),
    [
        ({"false_negative_burst": 10**19}, "false_negative_burst must be a whole number >= 1"),
        ({"false_positive_rate": float("inf")}, "false_positive_rate"),
        ({"camera_jitter": 0.5}, "camera_jitter"),
        ({"camera_position_sigma_m": float("nan")}, "camera_position_sigma_m"),
        ({"lidar_dead_rows": 3}, "lidar_dead_rows must be a list of rows"),
        ({"camera_confidence": 1.5}, "camera_confidence"),
    ],
)
def test_impossible_faults_are_refused_by_name(fault, named):
    with pytest.raises(InvalidInput, match=named):
        Sensing(**fault)


def test_equal_numbers_are_equal_conditions():
    ours = Conditions(false_negative_rate=np.float64(0), floor_seed=np.int64(1), lidar_dropout=1)
    assert ours == Conditions(floor_seed=1, lidar_dropout=1.0)
    assert [
        type(value) for value in (ours.false_negative_rate, ours.floor_seed, ours.lidar_dropout)
    ] == [
        float,
        int,
        float,
    ]


def test_the_scoring_looks_through_a_camera_that_stands_straight():
    """A crooked mount changes what is detected, not when the person counts as in view."""

    def in_view(**faults):
        env = gymnasium.make("CARE-Dartout-v0", floor=False, disable_env_checker=True, **faults)
        env.reset(seed=0)
        nothing = np.zeros(env.action_space.shape, np.float32)
        seen = [env.step(nothing)[-1]["in_view"] for _ in range(40)]
        env.close()
        return seen

    straight = in_view()
    assert any(straight)
    assert in_view(camera_rotation_sigma_deg=40.0) == straight


def timing(keyframe_s=0.1, step_s=0.05, **faults):
    return picture_timing(Sensing(**faults), keyframe_s, step_s)


@pytest.mark.parametrize(
    ("latency_s", "keyframes", "after_s"),
    [
        (0.0, 0, 0.0),
        (0.05, 1, 0.05),
        (0.1, 1, 0.0),
        (0.12, 2, 0.05),
        (0.3, 3, 0.0),
        (1e-3, 1, 0.05),
    ],
)
def test_a_latency_in_seconds_is_rounded_up_to_steps(latency_s, keyframes, after_s):
    assert timing(camera_latency_s=latency_s) == (keyframes, pytest.approx(after_s))


@given(st.floats(0, 60), st.integers(1, 20))
def test_the_picture_is_the_newest_that_is_old_enough(latency_s, per_keyframe):
    keyframe_s = per_keyframe * 0.05
    keyframes, after_s = timing(keyframe_s, 0.05, camera_latency_s=latency_s)
    age_s = keyframes * keyframe_s - after_s
    assert 0 <= after_s < keyframe_s
    assert latency_s - 1e-6 <= age_s < latency_s + 0.05 + 1e-6


@pytest.mark.parametrize(
    ("env_id", "keyframe_s"), [("CARE-Dense-v0", 0.1), ("CARE-Street-v0", 0.5)]
)
def test_seconds_and_whole_keyframes_are_the_same_episode(env_id, keyframe_s):
    def played(**faults):
        env = gymnasium.make(env_id, budget=0.05, disable_env_checker=True, **faults)
        choose = care_sim.make_policy("care", env)
        seen = [env.reset(seed=3)[0]]
        for _ in range(4):
            seen.append(env.step(choose(seen[-1]))[0])
        env.close()
        return seen

    more = {"camera_jitter": 1, "false_negative_rate": 0.3}
    ours = played(camera_latency=2, **more)
    theirs = played(camera_latency_s=2 * keyframe_s, **more)
    for our, their in zip(ours, theirs, strict=True):
        assert all(np.array_equal(our[name], their[name]) for name in our)


def test_keyframes_and_seconds_are_refused_together():
    with pytest.raises(InvalidInput, match=r"camera_latency_s .*, not both"):
        Sensing(camera_latency=1, camera_latency_s=0.1)
