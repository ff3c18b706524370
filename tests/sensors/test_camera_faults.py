"""Faults of the camera one by one, with known rates and known delays."""

import itertools

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import CAMERA_FAULTS, CameraFaults, Conditions, Sensing
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import Delay, Misses, PictureTiming, mounted
from care_sim.sensors.pictures import FRONT_CAMERA

NEAR, FAR = np.full(40, 10.0), np.full(40, 30.0)


def missed(frames, ranges=NEAR, seed=0, **faults):
    """(frames, objects) who was missed."""
    misses = Misses(len(ranges), CameraFaults(**faults), np.random.default_rng(seed))
    return np.array([misses.draw(ranges) for _ in range(frames)])


def runs(missing):
    """Lengths of the bursts that begin and end within the frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    return [end - start for start, end in edges.reshape(-1, 2) if start > 0 and end < len(missing)]


@pytest.mark.parametrize("burst", [1, 3, 10])
@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_bursts_leave_the_share_of_misses_as_it_is_from_the_first_frame_on(rate, burst):
    shares = np.array(
        [
            missed(400, false_negative_rate=rate, false_negative_burst=burst, seed=s)
            for s in range(8)
        ]
    )
    assert shares.mean() == pytest.approx(rate, abs=0.02)
    first = np.array(
        [
            missed(1, false_negative_rate=rate, false_negative_burst=burst, seed=s)
            for s in range(100)
        ]
    )
    assert first.mean() == pytest.approx(rate, abs=0.03)


def test_a_burst_lasts_its_keyframes():
    table = missed(500, false_negative_rate=0.1, false_negative_burst=5)
    lengths = [length for column in table.T for length in runs(column)]
    assert len(lengths) > 100
    assert {length % 5 for length in lengths} == {0}


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_nobody_or_everybody_is_missed_for_bursts_too(rate):
    assert np.all(missed(30, false_negative_rate=rate, false_negative_burst=4) == bool(rate))


def test_misses_grow_with_the_distance_up_to_all():
    faults = {"false_negative_rate": 0.1, "false_negative_per_m": 0.02}
    assert missed(500, NEAR, **faults).mean() == pytest.approx(0.3, abs=0.02)
    assert missed(500, FAR, **faults).mean() == pytest.approx(0.7, abs=0.02)
    assert missed(20, np.full(5, 60.0), **faults).all()


def tagged(number):
    """One detection that says which picture it is of."""
    row = [0, 0.9, number, 0, number + 1, 1, 0, 0, 0]
    return IdentifiedDetections(
        ImageDetections.from_rows(np.array([row], float)), np.array([number])
    )


def delivered(latency, jitter, frames, seed=0):
    delay = Delay(PictureTiming(latency, 0.0), jitter, 0.1, np.random.default_rng(seed))
    handed_out = []
    for n in range(frames):
        delay.take(tagged(n), 0.01 * n)
        handed_out.append(delay.newest(0.01 * n))
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


def test_without_jitter_every_picture_is_as_late_as_the_latency():
    assert [len(d) for d in delivered(2, 0, 5)] == [0, 0, 1, 1, 1]
    assert [int(d.boxes[0, 0]) for d in delivered(2, 0, 5)[2:]] == [0, 1, 2]


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


def test_a_crooked_camera_moves_the_boxes_and_not_the_world():
    straight, crooked = observations(), observations(camera_rotation_sigma_deg=3.0)
    assert not np.array_equal(straight[0]["detections"], crooked[0]["detections"])
    assert np.array_equal(straight[0]["ego"], crooked[0]["ego"])


def test_the_confidence_threshold_keeps_what_is_sure():
    usual, sure = (
        observations()[0]["detections"],
        observations(camera_confidence=0.5)[0]["detections"],
    )
    kept = usual[usual[:, 1] >= 0.5]
    assert 0 < len(kept) < np.sum(usual[:, 0] >= 0)
    assert np.array_equal(sure[: len(kept)], kept)
    assert np.all(sure[len(kept) :, 0] == -1)


def test_odometry_noise_has_its_spread_and_leaves_the_car_alone():
    true = np.array([o["ego"][0] for o in observations(keyframes=40)])
    read = np.array([o["ego"][0] for o in observations(keyframes=40, ego_speed_sigma=0.3)])
    assert np.std(read[:15] - true[:15]) == pytest.approx(0.3, rel=0.5)
    assert np.array_equal(
        [o["ego"][0] for o in observations(keyframes=3, ego_speed_sigma=0.0)], true[:4]
    )


@pytest.mark.parametrize("policy", ["care", "care-priority", "all-camera"])
def test_with_the_camera_black_camera_policies_scan_as_history(policy):
    dark = {"blackout_s": 10.0}
    ours, theirs = observations(policy, 25, **dark), observations("history", 25, **dark)
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
        ({"false_negative_burst": 0}, "false_negative_burst"),
        ({"false_negative_per_m": -0.1}, "false_negative_per_m"),
        ({"false_positive_rate": float("inf")}, "false_positive_rate"),
        ({"camera_jitter": 0.5}, "camera_jitter"),
        ({"blackout_s": -1.0}, "blackout_s"),
        ({"camera_rotation_sigma_deg": -1.0}, "camera_rotation_sigma_deg"),
        ({"camera_position_sigma_m": float("nan")}, "camera_position_sigma_m"),
        ({"lidar_dead_rows": (-1,)}, "lidar_dead_rows"),
        ({"lidar_dead_rows": 3}, "lidar_dead_rows must be a list of rows"),
        ({"lidar_dead_rows": None}, "lidar_dead_rows must be a list of rows"),
        ({"false_positive_rate": 1e20}, "false_positive_rate"),
        ({"camera_jitter": 2**70}, "camera_jitter must be a whole number >= 0 and <= 1200"),
        (
            {"false_negative_burst": 10**19},
            "false_negative_burst must be a whole number >= 1 and <= 1200",
        ),
        ({"engine": ["bullet"]}, "engine must be a name"),
        ({"ego_speed_sigma": -0.1}, "ego_speed_sigma"),
        ({"camera_confidence": 1.5}, "camera_confidence"),
    ],
)
def test_impossible_faults_are_refused_by_name(fault, named):
    with pytest.raises(InvalidInput, match=named):
        Sensing(**fault)


@pytest.mark.parametrize("change", [{"floor_seed": -1}, {"floor": 1}, {"azimuth_margin": 0.5}])
def test_impossible_conditions_are_refused_by_name(change):
    with pytest.raises(InvalidInput, match=next(iter(change))):
        gymnasium.make("CARE-Dense-v0", **change)


@pytest.mark.parametrize("rows", [[12, 9], (9, 12, 12), np.array([9, 12])])
def test_dead_rows_are_a_set_however_they_are_given(rows):
    assert Sensing(lidar_dead_rows=rows) == Sensing(lidar_dead_rows=(9, 12))


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


def test_all_faults_are_off_by_default():
    usual = Conditions()
    assert {getattr(usual, name) for name in CAMERA_FAULTS} == {"ideal", 0, 1}
    assert usual.false_negative_burst == 1


def test_floor_seeds_change_the_floor_alone():
    first, same, other = (observations("random", 2, floor_seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(first[1]["ranges"], same[1]["ranges"])
    assert not np.array_equal(first[1]["ranges"], other[1]["ranges"])
    assert np.array_equal(first[1]["detections"], other[1]["detections"])
