"""World i of a vector environment is the single environment, to the last bit."""

import pytest

from care_sim import InvalidInput
from care_sim.core.conditions import DEFAULTS
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import SensorSetup
from care_sim.envs import CLOSED_LOOP
from care_sim.envs.scenarios import DartoutEnv
from care_sim.envs.vector.env import ClosedLoopVectorEnv
from tests.helpers.vectors import MODES, native, played_alike

LATE = {"camera_latency": 2, "camera_jitter": 1}
BLIND = {"blackout_start_s": 1.0, "blackout_s": 1.5}
MISSING = {"false_negative_rate": 0.3, "false_negative_per_m": 0.01, "false_negative_burst": 4}
CONDITIONS = {
    "late": LATE,
    "missing": MISSING,
    "blind, late and missing": LATE | BLIND | MISSING,
    "unsure": {"camera_confidence": 0.7},
    "listed otherwise": {"cell_order": "core-spread", "reserve_fraction": 0.5, "floor_seed": 2},
    "without a floor": {"floor": False, "budget": 0.2},
    "half a cell": {"floor": False, "budget": 53 / 16384, "reserve_fraction": 0.5},
    "smoothed": {"velocity_keyframes": 5},
    "wide margins": {"azimuth_margin": 4, "elevation_margin": 3},
    "thorough": {"min_returns": 8, "brake_for_oncoming": True, "brake_side_margin_m": 1.0},
    "another brake": {
        "brake_mps2": 8.0,
        "brake_standstill_m": 3.0,
        "brake_horizon_s": 3.0,
        "brake_release_s": 1.0,
        "comfort_mps2": 2.5,
    },
    "slow": {"keyframe_s": 0.2, "duration_s": 4.0, "brake_reaction_s": 0.3},
    "on the other side": {"mirrored": "drawn"},
    "on a collision course": {"encroachment_s": (-0.2, -0.1), "ego_speed_mps": (12.0, 13.0)},
    "with all that a learner gains": {"reward_weights": {"gain": 2.0}},
    "without scoring": {"scoring_info": False, "secret": "a text that nobody knows"},
    "several cameras": {"sensor": "paper-vehicle", "duration_s": 3.0} | LATE,
    # In these, stages go world by world.
    "noisy": {"lidar_range_sigma": 0.05, "lidar_dropout": 0.2, "lidar_dead_rows": (3, 4)},
    "jammed": {"lidar_crosstalk": 0.1},
    "rolling": {"lidar_sweep_s": 0.1, "lidar_compensated": True},
    "wide beams": {"lidar_divergence_mrad": 3.0, "lidar_returns": "both"},
    "weather": {
        "lidar_stated_range_m": 40.0,
        "lidar_stated_reflectance": 0.2,
        "visibility_m": 200.0,
        "rain_mm_h": 20.0,
    },
    "by tiles": {"firing": "tiles:4x8"},
    "shared energy": {"firing": "energy:3"},
    "a window without a floor": {"firing": "azimuth-window", "floor": False},
    "a measured detector": {"detector": "centerpoint"},
    "a detector of points": {"detector": "cluster", "duration_s": 1.0},
    "lost": {
        "ego_speed_sigma": 0.5,
        "ego_position_sigma_m": 0.3,
        "ego_yaw_sigma_deg": 1.0,
        "ego_pose_correlation_s": 1.0,
    },
    "a human": {"driver": "careful-human"},
    "bullet": {"engine": "bullet", "duration_s": 0.6, "false_positive_rate": 1.0},
    "a camera that invents": {"false_positive_rate": 1.0, "camera_latency_s": 0.13},
    "crooked": {"camera_rotation_sigma_deg": 1.0, "camera_position_sigma_m": 0.1},
    "a measured camera": {"camera_profile": "kitti"} | LATE,
}
SLOW_CONDITIONS = {
    "rolling",
    "a detector of points",
    "bullet",
    "a camera that invents",
    "a measured camera",
}

OWN_BUDGETS = {"budget": [0.01, 0.2, 0.03]}
OWN_FAULTS = {
    "false_negative_rate": [1.0, 0.3, 0.0],
    "false_negative_per_m": [0.0, 0.0, 0.01],
    "false_negative_burst": [4, 1, 2],
    "camera_latency": [2, 0, 1],
    "camera_jitter": [0, 0, 2],
    "blackout_start_s": [0.0, 1.0, 0.5],
    "blackout_s": [0.0, 1.5, 0.2],
    "camera_confidence": [0.25, 0.4, 0.8],
}
OWN = {
    "budgets": OWN_BUDGETS,
    "equal budgets": {"budget": [0.03] * 3},
    "faults": OWN_FAULTS,
    "both": OWN_BUDGETS | OWN_FAULTS,
    "budgets without a floor": OWN_BUDGETS | {"floor": False},
    "budgets without scoring": OWN_BUDGETS | {"scoring_info": False},
    "budgets of noisy worlds": OWN_BUDGETS | {"lidar_dropout": 0.2},
    "one profile of a detector": {"camera_profile": ["kitti", "yolox", "ideal"]},
}


@pytest.mark.parametrize(
    ("name", "mode"),
    [(name, MODES[number % len(MODES)]) for number, name in enumerate(CLOSED_LOOP)],
)
def test_every_world_and_every_mode(name, mode):
    steps = 8 if name == "CARE-Drive-v0" else 64
    assert played_alike(name, worlds=3, steps=steps, mode=mode, threads=2) is None


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("arguments", [{}, {"lidar_dropout": 0.2}], ids=["plain", "noisy"])
def test_episodes_end_after_the_most_steps(mode, arguments):
    arguments = arguments | {"max_episode_steps": 5}
    assert played_alike("CARE-CutIn-v0", worlds=2, steps=14, mode=mode, **arguments) is None


@pytest.mark.parametrize("name", CONDITIONS)
def test_conditions(name):
    arguments = {"budget": 0.03} | CONDITIONS[name]
    steps = 8 if name in SLOW_CONDITIONS else 62
    assert played_alike("CARE-Dense-v0", worlds=2, steps=steps, **arguments) is None


def test_every_condition_is_played():
    """One that nobody played here would be lost without a word."""
    played = {name for own in (*CONDITIONS.values(), *OWN.values()) for name in own}
    # These are of films.
    assert {*DEFAULTS} - played == {"sweep_mask", "clutter"}


@pytest.mark.parametrize("own", OWN.values(), ids=OWN)
def test_arguments_of_each_world(own):
    assert played_alike("CARE-Dense-v0", worlds=3, steps=62, threads=2, **own) is None


@pytest.mark.parametrize("mode", MODES)
def test_budgets_of_each_world_in_every_mode(mode):
    arguments = OWN_BUDGETS | {"duration_s": 1.0}
    assert played_alike("CARE-CutIn-v0", worlds=3, steps=24, mode=mode, **arguments) is None


@pytest.mark.parametrize(("worlds", "threads"), [(1, 1), (5, 1), (5, 2), (5, 8)])
def test_numbers_of_worlds_and_threads(worlds, threads):
    assert played_alike("CARE-CutIn-v0", worlds=worlds, steps=30, threads=threads) is None


def test_more_detections_than_an_observation_holds():
    cameras = [PinholeCamera(position=(0.6, 0.01 * n, 0.0)) for n in range(24)]
    arguments = {"sensor": SensorSetup("many", cameras=tuple(cameras)), "vehicles": 12}
    env = native("CARE-Dense-v0", 1, **arguments)
    assert (env.reset(seed=3)[0]["detections"][..., 0] >= 0).all()
    env.close()
    assert played_alike("CARE-Dense-v0", worlds=2, steps=12, **LATE, **arguments) is None


class Miser(DartoutEnv):
    """Pays nothing."""

    def step(self, action):
        observation, _, *rest = super().step(action)
        return observation, 0.0, *rest


class Misers(ClosedLoopVectorEnv):
    single = Miser


def test_a_class_with_a_step_of_its_own_is_refused_in_one_line():
    with pytest.raises(InvalidInput, match="Miser has its own step, which many"):
        Misers(2, threads=1)
