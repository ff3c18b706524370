"""Engines compared in whole episodes: the cells that fire, what is detected, how the car drives,
how it ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from care_sim.evaluation.metrics import outcome
from care_sim.loops.records import Keyframe
from care_sim.measure.parity.exact import exactly
from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import trace

_ENGINES = ("fast", "bullet")


class Outcomes:
    """Counts of episodes played under both engines, and labels of those that differ, in the outcome
    or at any keyframe. Where the outcomes differ, Bullet in millimetres plays the episode too.
    """

    def __init__(self) -> None:
        self.episodes = 0
        self.keyframes = 0
        self.other_outcomes: list[str] = []
        self.other_keyframes: list[str] = []
        self.other_than_exact: list[str] = []

    def compare(self, config: EpisodeConfig) -> None:
        """Play an episode under both engines."""
        (_, drawn), (_, expected) = (trace(config.changed(engine=engine)) for engine in _ENGINES)
        self.episodes += 1
        self.keyframes += len(expected)
        # An outcome that differs from Bullet's may be owed to Bullet's tolerance.
        if outcome(drawn) != outcome(expected):
            self.other_outcomes.append(config.label)
            if outcome(drawn) != outcome(_exact(config)):
                self.other_than_exact.append(config.label)
        if len(drawn) != len(expected) or not all(map(_same, drawn, expected)):
            self.other_keyframes.append(config.label)

    def figures(self) -> dict[str, Any]:
        """The counts, and the labels of the episodes that differ."""
        return dict(vars(self))


def outcomes(seeds: int, done: Callable[[int], None]) -> Outcomes:
    """The paper's 49 configurations with seeds from 0; `done` is called with the
    number of seeds compared so far.
    """
    compared = Outcomes()
    for seed in range(seeds):
        for config in paper_study([seed]):
            compared.compare(config)
        done(seed + 1)
    return compared


def _exact(config: EpisodeConfig) -> list[Keyframe]:
    with exactly() as engine:
        return trace(config.changed(engine=engine))[1]


def _same(one: Keyframe, other: Keyframe) -> bool:
    """Whether two records are the same to the last bit."""
    names: Sequence[str] = [field.name for field in fields(Keyframe)]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
