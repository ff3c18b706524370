"""Every observation lies in the space of its environment, whatever goes wrong and whoever drove."""

import json

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import care_sim
from care_sim.envs import CLOSED_LOOP
from care_sim.sources.nuscenes.tables import CAMERA_CHANNELS
from tests.helpers.av2_log import CAR_AHEAD, at, box, write
from tests.helpers.nuscenes_drive import write_drive

FAULTS = {
    "camera_profile": st.sampled_from(["ideal", "yolox"]),
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


def play(env, policy="care", seed=0):
    """Play an episode; every observation is in the space and is what the loop believes."""
    chooses = care_sim.make_policy(policy, env)
    observation, _ = env.reset(seed=seed)
    chooses.reset()
    over = False
    while not over:
        assert env.observation_space.contains(observation)
        held = env.unwrapped.loop.belief.to_observation()
        assert all(np.array_equal(observation[name], held[name]) for name in held)
        observation, _, terminated, truncated, _ = env.step(chooses(observation))
        over = terminated or truncated
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


def test_an_odometer_that_reads_anything():
    env = gymnasium.make(
        "CARE-Dartout-v0", disable_env_checker=True, duration_s=0.5, ego_speed_sigma=10.0
    )
    play(env)
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


def detections_file(path, root):
    """A car in every picture, across the left edge, the right edge, the lower edge and wholly
    outside it.
    """
    tables = json.loads((root / "v1.0-trainval" / "sample_data.json").read_text())
    pictures = [
        row["token"]
        for row in tables
        if any(channel in row["token"] for channel in CAMERA_CHANNELS)
    ]
    boxes = (
        [-30, 300, 100, 500],
        [1500, 300, 1630, 500],
        [800, 700, 900, 950],
        [-90, 300, -40, 500],
        [1, 2, 3, 4],
    )
    rows = [
        {
            "sample_data_token": token,
            "bbox_corners": box,
            "category_name": "vehicle.car",
            "score": 0.9,
        }
        for token in pictures
        for box in boxes
    ]
    path.write_text(json.dumps(rows))
    return path


@pytest.mark.parametrize("detector", [False, True])
def test_a_nuscenes_scene(tmp_path, detector):
    root = write_drive(tmp_path / "nuscenes")
    own = {"camera_detections": detections_file(tmp_path / "found.json", root)} if detector else {}
    play(
        gymnasium.make("CARE-Replay-v0", disable_env_checker=True, source=f"nuscenes:{root}", **own)
    )
