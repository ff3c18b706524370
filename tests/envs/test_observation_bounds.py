"""Every observation lies in the space of its environment, whatever goes wrong and whoever drove."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.envs import CLOSED_LOOP
from tests.helpers.av2_log import CAR_AHEAD, at, box, write
from tests.helpers.episodes import played

FAULTS = {
    "camera_profile": st.sampled_from(["ideal", "yolox", "kitti"]),
    "false_negative_rate": st.floats(0, 1),
    "false_negative_per_m": st.floats(0, 1),
    "false_negative_burst": st.integers(1, 1000),
    "false_positive_rate": st.floats(0, 64),
    "camera_latency": st.integers(0, 50),
    "camera_jitter": st.integers(0, 50),
    "lidar_range_sigma": st.floats(0, 50),
    "lidar_dropout": st.floats(0, 1),
    "ego_speed_sigma": st.floats(0, 10),
    "min_returns": st.integers(1, 3),
}
MOUNTS = {
    "camera_rotation_sigma_deg": st.floats(0, 180),
    "camera_position_sigma_m": st.floats(0, 10),
}


def play(env, seed=0):
    """Play an episode; every observation is in the space."""
    for observation, *_ in played(env, "care", seed):
        assert env.observation_space.contains(observation)


@pytest.mark.parametrize("name", CLOSED_LOOP)
@given(
    faults=st.fixed_dictionaries({}, optional=FAULTS | MOUNTS),
    keyframe_s=st.sampled_from([0.05, 0.1, 0.3]),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=6)
def test_the_closed_loop_under_all_faults(name, faults, keyframe_s, seed):
    duration_s = max(0.4, 2 * keyframe_s)
    env = gymnasium.make(
        name, disable_env_checker=True, keyframe_s=keyframe_s, duration_s=duration_s, **faults
    )
    play(env, seed=seed)
    env.close()


@pytest.fixture(scope="session")
def roll_back(tmp_path_factory):
    """A log whose car stands, then rolls back by a hair, while someone jumps to and fro."""
    jumps = [
        box("REGULAR_VEHICLE", (12.0 + 9 * (n // 5 % 2), 5.0, 0.42), track="j") for n in range(21)
    ]
    poses = [at(-2e-5 * n) for n in range(21)]
    return write(
        tmp_path_factory.mktemp("logs") / "back", [[CAR_AHEAD, jump] for jump in jumps], poses
    )


@given(faults=st.fixed_dictionaries({}, optional=FAULTS), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=6)
def test_a_recorded_log_under_all_faults(drive, faults, seed):
    play(
        gymnasium.make(
            "CARE-Replay-v0", disable_env_checker=True, source=f"argoverse2:{drive}", **faults
        ),
        seed=seed,
    )


def test_a_recorded_car_that_rolls_back(roll_back):
    env = gymnasium.make(
        "CARE-Replay-v0", disable_env_checker=True, source=f"argoverse2:{roll_back}", budget=0.5
    )
    play(env)
    env.reset()
    # The first keyframe has no past to take a speed from.
    env.step(np.zeros(env.action_space.shape, np.float32))
    assert env.unwrapped.loop.belief.ego.speed == pytest.approx(-2e-4, rel=1e-3)
