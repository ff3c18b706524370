"""What is measured, and for how long."""

from dataclasses import dataclass

import numpy as np

from care_sim.envs import ENVIRONMENT_IDS
from care_sim.study.episode_config import EpisodeConfig

EPISODE = EpisodeConfig("dense", "care", 0.1, 0)
"""The episode that is played unless a row says otherwise; its seed is that of all scenes."""
MAIN = ENVIRONMENT_IDS[EPISODE.scenario]


@dataclass(frozen=True)
class Settings:
    """`seconds` of every single measurement of steps; `repeats`, rounds in each of which everything
    is measured once; `samples`, scans per engine and choices per round.
    """

    seconds: float = 3.0
    repeats: int = 3
    samples: int = 200


def middle(values):
    """The median."""
    return float(np.median(values))


def by_name(rounds):
    """Figures of several rounds, round by round under each name."""
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}
