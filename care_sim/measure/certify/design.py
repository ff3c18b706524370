"""The list: what an episode of a number is made of.

Every factor is drawn by itself, so that a thousand episodes hold every pair of an environment, a
policy, a fault, a setting and a mode that can meet. The open loop detects with the paper's proxy:
the detector `cluster` fits the road by iteration, which ends a little elsewhere on another
processor.
"""

from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Any

from care_sim.policies import BUILT_IN
from care_sim.policies.parameters import is_privileged

CLOSED = ("CARE-Dartout-v0", "CARE-Dense-v0", "CARE-CutIn-v0")
STREET, REPLAY = "CARE-Street-v0", "CARE-Replay-v0"
ENVIRONMENTS = (*CLOSED, *CLOSED, STREET, REPLAY)
"""Drawn from: the closed loop takes three quarters."""

POLICIES = (
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
)
"""Written out, because one more changes what every episode is made of."""

AS_LISTED: dict[str, dict[str, Any]] = {"seed-finder": {"scenario": "dense"}}
"""Parameters of policies in the whole list, which was published when `seed-finder` knew the dense
street alone.
"""

SINGLE, INTERLEAVED, SYNC, ASYNC, SUBPROCESS, HASH_SEED = MODES = (
    "single", "interleaved", "sync", "async", "subprocess", "hash-seed",
)  # fmt: skip
"""How an episode is played: alone; in turns with others in one process; in Gymnasium's vectors; in
the subprocesses of Stable-Baselines3; in an interpreter with another hash seed. None may change it.
"""
IN_OTHER_PROCESSES = (ASYNC, SUBPROCESS)

BUDGETS = (0.01, 0.03, 0.05, 0.1, 0.2, 0.35)
FAULTS: dict[str, dict[str, Any]] = {
    "false_negative_rate": {"false_negative_rate": 0.4},
    "false_negative_per_m": {"false_negative_per_m": 0.02},
    "false_negative_burst": {"false_negative_rate": 0.3, "false_negative_burst": 4},
    "false_positive_rate": {"false_positive_rate": 1.0},
    "camera_latency": {"camera_latency": 2},
    "camera_jitter": {"camera_jitter": 2},
    "blackout_s": {"blackout_start_s": 0.3, "blackout_s": 0.5},
    "camera_rotation_sigma_deg": {"camera_rotation_sigma_deg": 1.5},
    "camera_position_sigma_m": {"camera_position_sigma_m": 0.1},
    "lidar_range_sigma": {"lidar_range_sigma": 0.05},
    "lidar_dropout": {"lidar_dropout": 0.3},
    "lidar_dead_rows": {"lidar_dead_rows": (9, 10, 17)},
    "ego_speed_sigma": {"ego_speed_sigma": 0.5},
}
"""Every fault of `care_sim.core.conditions`, strong enough to be felt in a few keyframes."""
SETTINGS: dict[str, dict[str, Any]] = {
    "engine": {"engine": "bullet"},
    "keyframe_s": {"keyframe_s": 0.25},
    "min_returns": {"min_returns": 1},
    "camera_confidence": {"camera_confidence": 0.5},
    "reserve_fraction": {"reserve_fraction": 0.6},
    "floor": {"floor": False},
    "floor_seed": {"floor_seed": 2},
    "azimuth_margin": {"azimuth_margin": 4},
    "elevation_margin": {"elevation_margin": 0},
}
CLOSED_ALONE = ("camera_rotation_sigma_deg", "camera_position_sigma_m", "engine", "keyframe_s")
"""What a film cannot take on."""

CLOSED_KEYFRAMES = (*(4,) * 7, *(6,) * 4, *(8,) * 5, 12, 12, 16, 60)
OPEN_KEYFRAMES = (2, 4, 4, 8, 8, 12, 40)
"""Lengths: mostly short, some whole."""
STREETS, MORE_STREETS = (3000, 3001), tuple(range(3000, 3012))
"""Seeds that belong to no list. A street takes seconds to make, so that a thousand episodes share
two.
"""


@dataclass(frozen=True)
class Drawn:
    """An episode of the list. `arguments` are those of the environment."""

    number: int
    environment: str
    arguments: tuple[tuple[str, Any], ...]
    policy: str
    seed: int
    keyframes: int
    mode: str

    @property
    def text(self) -> str:
        """Everything that decides it, in a line."""
        arguments = "".join(f", {name}={value!r}" for name, value in self.arguments)
        played = f"policy {self.policy}, seed {self.seed}, {self.keyframes} keyframes"
        return f'gym.make("{self.environment}"{arguments}), {played}'


@cache
def drawn(number: int) -> Drawn:
    """The episode of a number."""
    rng = Random(f"care-sim certify {number}")
    environment, policy = rng.choice(ENVIRONMENTS), rng.choice(POLICIES)
    budget, closed = rng.choice(BUDGETS), environment in CLOSED
    arguments: dict[str, Any] = {"budget": 1.0 if policy == "full" else budget}
    for choices, most in ((FAULTS, (0, 1, 1, 2, 3)), (SETTINGS, (0, 1, 1, 2))):
        possible = [name for name in choices if closed or name not in CLOSED_ALONE]
        for name in rng.sample(possible, rng.choice(most)):
            arguments |= choices[name]
    return Drawn(
        number,
        environment,
        tuple(arguments.items()),
        policy,
        rng.choice(STREETS if number < 1000 else MORE_STREETS)
        if environment == STREET
        else rng.randrange(1000),
        rng.choice(CLOSED_KEYFRAMES if closed else OPEN_KEYFRAMES),
        rng.choice(modes(environment, policy)),
    )


def modes(environment: str, policy: str) -> list[str]:
    """How such an episode can be played: truth does not travel between processes, and a street is
    made once a process.

    Those that are quick to begin stand several times.
    """
    apart = IN_OTHER_PROCESSES if is_privileged(BUILT_IN[policy]) else ()
    elsewhere = (HASH_SEED,) if environment == STREET else ()
    return [
        mode
        for mode in (SINGLE, SINGLE, SINGLE, INTERLEAVED, *MODES)
        if mode not in (*apart, *elsewhere)
    ]
