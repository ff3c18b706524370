"""The list of episodes: what the episode of a number is made of.

Everything is drawn independently, so that the first `CERTIFIED_EPISODES` hold every pair of an
environment, a policy and a choice of any group below that can meet. The order of the draws is a
part of the list.
"""

from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Any

from care_sim.certify import CERTIFIED_EPISODES

NCAP = "CARE-NCAP-v0"
DRIVE = "CARE-Drive-v0"
CLOSED = (
    "CARE-Dartout-v0",
    "CARE-Dense-v0",
    "CARE-CutIn-v0",
    "CARE-R157-v0",
    NCAP,
    DRIVE,
)
STREET = "CARE-Street-v0"
REPLAY = "CARE-Replay-v0"
_ENVIRONMENTS = (*CLOSED, STREET, REPLAY)
"""Environments to draw from; three quarters are closed loop. Written out, as the policies are."""

CERTIFIED_POLICIES = (
    "full",
    "random",
    "history",
    "history-uniform",
    "uncertainty",
    "beam-reduce",
    "all-camera",
    "care",
    "care-priority",
    "care-sbf",
    "history-oracle",
    "random-points",
    "farthest-points",
    "learned-scorer",
    "ppo",
    "ppo-dartout",
    "seed-finder",
    "care-spread",
    "care-sightlines",
    "rows",
    "fan",
    "stride",
    "sweep",
    "place",
    "history-rows",
    "history-place",
    "learned-place",
    "history-learned-place",
    "care-sector",
    "place-hulls",
    "care-units",
    "learned-sets",
    "boxes",
    "tuned-place",
    "after-shoouri",
    "after-ancha",
    "after-gofer",
    "care-aimed",
)
"""Written out, because one more changes what every episode of the list is made of."""
_KNOWN_SEEDS = 3
AS_LISTED: dict[str, dict[str, Any]] = {
    "seed-finder": {"seeds": _KNOWN_SEEDS},
    "learned-place": {"seeds": 1},
    "history-learned-place": {"seeds": 1},
}
"""Parameters of policies, the same in the whole list. These play whole episodes before their first
keyframe, as many as they have seeds.
"""

_BUDGETS = (0.01, 0.03, 0.05, 0.1, 0.2, 0.35)
CERTIFIED_FAULTS: dict[str, dict[str, Any]] = {
    "false_negative_rate": {"false_negative_rate": 0.4},
    "false_negative_per_m": {"false_negative_per_m": 0.02},
    "false_negative_burst": {"false_negative_rate": 0.4, "false_negative_burst": 4},
    "false_positive_rate": {"false_positive_rate": 1.0},
    "camera_jitter": {"camera_jitter": 2},
    "blackout_s": {"blackout_start_s": 0.3, "blackout_s": 0.5},
    "camera_rotation_sigma_deg": {"camera_rotation_sigma_deg": 1.5},
    "camera_position_sigma_m": {"camera_position_sigma_m": 0.1},
    "lidar_range_sigma": {"lidar_range_sigma": 0.05},
    "lidar_dropout": {"lidar_dropout": 0.3},
    "lidar_dead_rows": {"lidar_dead_rows": (9, 10, 17)},
    "ego_speed_sigma": {"ego_speed_sigma": 0.5},
    "localisation": {
        "ego_position_sigma_m": 0.3,
        "ego_yaw_sigma_deg": 1.0,
        "ego_pose_correlation_s": 1.0,
    },
    "crosstalk": {"lidar_crosstalk": 0.1},
    "weather": {
        "lidar_stated_range_m": 40.0,
        "lidar_stated_reflectance": 0.2,
        "visibility_m": 200.0,
        "rain_mm_h": 20.0,
    },
    "beams": {
        "lidar_divergence_mrad": 3.0,
        "lidar_returns": "both",
        "lidar_sweep_s": 0.1,
    },
}
"""Faults of `care_sim.core.conditions`, strong enough to act within a few keyframes."""
CERTIFIED_CAMERAS: dict[str, dict[str, Any]] = {
    "camera_latency": {"camera_latency": 2},
    "yolox": {"camera_profile": "yolox"},
    "kitti": {"camera_profile": "kitti", "camera_latency_s": 0.12},
}
"""The last one is the camera of the benchmark."""
CERTIFIED_DETECTORS: dict[str, dict[str, Any]] = {
    "min_returns": {"min_returns": 1},
    "centerpoint": {"detector": "centerpoint"},
    "megvii": {"detector": "megvii"},
    "pointrcnn": {"detector": "pointrcnn"},
}
"""The threshold belongs to the paper's proxy, the detector without any of these."""
CERTIFIED_SETTINGS: dict[str, dict[str, Any]] = {
    "engine": {"engine": "bullet"},
    "keyframe_s": {"keyframe_s": 0.25},
    "velocity_keyframes": {"velocity_keyframes": 5},
    "camera_confidence": {"camera_confidence": 0.5},
    "reserve_fraction": {"reserve_fraction": 0.6},
    "floor": {"floor": False},
    "floor_seed": {"floor_seed": 2},
    "azimuth_margin": {"azimuth_margin": 4},
    "elevation_margin": {"elevation_margin": 0},
    "cell_order": {"cell_order": "core-spread"},
    "reward_weights": {"reward_weights": {"gain": 1.0}},
    "firing": {"firing": "tiles"},
}
CERTIFIED_DRIVERS: dict[str, dict[str, Any]] = {
    "driver": {"driver": "careful-human"},
    "brake_for_oncoming": {"brake_for_oncoming": True},
    "braking": {
        "brake_mps2": 8.0,
        "brake_reaction_s": 0.1,
        "brake_standstill_m": 1.0,
        "brake_horizon_s": 3.0,
        "brake_side_margin_m": 0.6,
        "brake_release_s": 0.2,
        "comfort_mps2": 2.5,
    },
}
"""The careful human does not know the rules of the fixed driver."""
CERTIFIED_CHOICES = (
    (CERTIFIED_FAULTS, (0, 1, 1, 2, 3)),
    (CERTIFIED_SETTINGS, (0, 1, 1, 2)),
    (CERTIFIED_CAMERAS, (0, 1)),
    (CERTIFIED_DETECTORS, (0, 1)),
    (CERTIFIED_DRIVERS, (0, 1)),
)
"""Groups of choices, and how many of a group an episode has. Some groups allow one at most."""
_USUAL: dict[str, Any] = {}
DRAWN_TEST = {"test": "drawn", "speed_kph": 0}
CLUTTER = {"clutter": True}
CERTIFIED_WORLDS: dict[str, tuple[dict[str, Any], ...]] = {
    NCAP: (_USUAL, DRAWN_TEST, DRAWN_TEST),
    DRIVE: (
        _USUAL,
        {"encounters": 2, "side": "left", "turn_chance": 1.0},
        {"who": "child", "occluder_reported": True},
    ),
    STREET: (_USUAL, CLUTTER),
}
"""Parameters of worlds; the others play with their own defaults."""
_CLOSED_ALONE = (
    "camera_rotation_sigma_deg",
    "camera_position_sigma_m",
    "weather",
    "beams",
    "engine",
    "keyframe_s",
    "reward_weights",
    *CERTIFIED_DRIVERS,
)
CERTIFIED_WITHOUT: dict[str, tuple[str, ...]] = {
    STREET: _CLOSED_ALONE,
    REPLAY: _CLOSED_ALONE,
    DRIVE: ("engine",),
}
"""Choices that the list leaves out of an environment. Recordings lack these, and streets most of
them; a street would have to be filmed for every weather. Bullet needs minutes for some drives,
since false boxes come from another whole drive.
"""

_CLOSED_KEYFRAMES = (*(4,) * 7, *(6,) * 4, *(8,) * 5, 12, 12, 16, 60)
_OPEN_KEYFRAMES = (2, 4, 4, 8, 8, 12, 40)
"""Numbers of keyframes that are played: mostly few, sometimes the whole episode."""
STREETS = (3000, 3001)
"""Seeds of streets of the first `CERTIFIED_EPISODES`, which share two because a street takes
seconds to make. No published street is of the validation split, of which they are.
"""
_MORE_STREETS = tuple(range(3000, 3012))
"""Seeds of streets of the others."""


@dataclass(frozen=True)
class Drawn:
    """An episode of the list. `arguments` are those of the environment."""

    number: int
    environment: str
    arguments: tuple[tuple[str, Any], ...]
    policy: str
    seed: int
    keyframes: int

    @property
    def text(self) -> str:
        """Everything that decides the episode, in one line."""
        arguments = "".join(f", {name}={value!r}" for name, value in self.arguments)
        played = f"policy {self.policy}, seed {self.seed}, {self.keyframes} keyframes"
        return f'gym.make("{self.environment}"{arguments}), {played}'


@cache
def drawn(number: int) -> Drawn:
    """The episode of a number."""
    rng = Random(f"care-sim certify {number}")
    environment = rng.choice(_ENVIRONMENTS)
    policy = rng.choice(CERTIFIED_POLICIES)
    budget = rng.choice(_BUDGETS)
    closed = environment in CLOSED

    arguments: dict[str, Any] = {"budget": 1.0 if policy == "full" else budget}
    for choices, numbers in CERTIFIED_CHOICES:
        possible = [n for n in choices if n not in CERTIFIED_WITHOUT.get(environment, ())]
        for name in rng.sample(possible, min(rng.choice(numbers), len(possible))):
            arguments |= choices[name]
    arguments |= rng.choice(CERTIFIED_WORLDS.get(environment, (_USUAL,)))

    if environment == STREET:
        seed = rng.choice(STREETS if number < CERTIFIED_EPISODES else _MORE_STREETS)
    else:
        # One that `seed-finder` knows, where it plays.
        seed = rng.randrange(_KNOWN_SEEDS if policy == "seed-finder" else 1000)
    keyframes = rng.choice(_CLOSED_KEYFRAMES if closed else _OPEN_KEYFRAMES)
    return Drawn(number, environment, tuple(arguments.items()), policy, seed, keyframes)
