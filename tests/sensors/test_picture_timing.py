"""When the pictures are taken, for latencies in keyframes and in seconds."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Sensing
from care_sim.sensors.camera import picture_timing


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


def test_a_film_has_the_pictures_of_its_keyframes_alone():
    assert timing(0.5, 0.5, camera_latency_s=0.12) == (1, 0.0)
    assert timing(0.5, 0.5, camera_latency_s=0.5) == (1, 0.0)
    assert timing(0.5, 0.5, camera_latency_s=0.51) == (2, 0.0)


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
