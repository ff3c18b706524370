"""Learning curves of training runs, read from their folders and grouped.

Runs of a group differ by their seed alone.
"""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.training.config import BEFORE, HOW_LONG
from care_sim.training.episodes import LEARNER, EpisodeRow, read_episodes
from care_sim.training.folder import (
    CONFIG,
    CURVE,
    RULES,
    Evaluation,
    read_config,
    read_curve,
    read_rules,
)

NOTHING, EVERYTHING = "random", "full"
"""The rules between which scores are measured where environments differ: 0 and 1."""


@dataclass(frozen=True)
class TrainingRun:
    """A run: its configuration, what rules score on its validation seeds, its evaluations, and the
    episodes of all, of which a run of before has none.
    """

    config: Mapping[str, Any]
    rules: Mapping[str, Mapping[str, float]]
    curve: Sequence[Evaluation]
    episodes: Sequence[EpisodeRow] = ()

    @property
    def recipe(self) -> str:
        """What is the same in all runs of a panel: the configuration without seed and length."""
        told = {**BEFORE, **self.config}
        return json.dumps(
            {name: told[name] for name in told if name not in ("seed", *HOW_LONG)}, sort_keys=True
        )

    @property
    def closed_loop(self) -> bool:
        """Whether a first detection has a distance; the return alone is measured otherwise."""
        return all(distance is not None for *_, distance in self.curve)

    @property
    def unit(self) -> str:
        """Of the scores."""
        if len(self.tasks) > 1:
            return f"score ({NOTHING} 0, {EVERYTHING} 1)"
        return "first detection (m; 0 if never)" if self.closed_loop else "return"

    @cached_property
    def tasks(self) -> list[str]:
        """The environments that are scored each by itself; one that `NOTHING` plays as well as
        `EVERYTHING` tells nothing, unless it is the only one.
        """
        names = [*dict.fromkeys(row.played.env for row in self.episodes)]
        if len(names) < 2:
            return names or [" ".join(np.atleast_1d(self.config["env"]))]
        low, high = (self._means(rule, 0) for rule in (NOTHING, EVERYTHING))
        return [name for name in names if name in low and low[name] < high.get(name, -np.inf)]

    @cached_property
    def marks(self) -> dict[str, Floats]:
        """(tasks,) what the rules reach by name, measured as `scores`."""
        if len(self.tasks) > 1:
            return {rule: self._normalised(rule, 0) for rule in self.rules}
        scores = self.rules.items()
        return {
            name: np.array([s["mean_return"] if s["distance_m"] is None else s["distance_m"]])
            for name, s in scores
        }

    @property
    def steps(self) -> list[int]:
        """Environment steps at each evaluation."""
        return [steps for steps, *_ in self.curve]

    @cached_property
    def scores(self) -> Floats:
        """(evaluations, tasks) of one environment metres of the first detection, or the return; of
        several the return between those of `NOTHING` and `EVERYTHING`, which has no unit.
        """
        if len(self.tasks) > 1:
            return np.array([self._normalised(LEARNER, steps) for steps in self.steps])
        return np.array(
            [[value if distance is None else distance] for _, _, value, distance in self.curve]
        )

    def each(self, policy: str, steps: int = 0) -> Floats:
        """(episodes,) what a policy reached in every episode, by ascending seed, in the unit of
        `scores` of one environment; of several the return. Nothing where the run does not tell.
        """
        metres = len(self.tasks) == 1 and self.closed_loop
        rows = sorted(
            (row.played.seed, (row.played.distance_m or 0.0) if metres else row.played.total)
            for row in self.episodes
            if (row.policy, row.steps) == (policy, steps)
        )
        return np.array([value for _, value in rows])

    def _normalised(self, policy: str, steps: int) -> Floats:
        low, high, own = (
            self._means(*one) for one in ((NOTHING, 0), (EVERYTHING, 0), (policy, steps))
        )
        try:
            return np.array([(own[t] - low[t]) / (high[t] - low[t]) for t in self.tasks])
        except KeyError as error:
            raise InvalidInput(
                f"the episodes of a run of seed {self.config['seed']} lack those of {policy} after "
                f"{steps} steps in {error}"
            ) from error

    def _means(self, policy: str, steps: int) -> dict[str, float]:
        """The mean return of a policy by environment."""
        totals: dict[str, list[float]] = {}
        for row in self.episodes:
            if (row.policy, row.steps) == (policy, steps):
                totals.setdefault(row.played.env, []).append(row.played.total)
        return {name: float(np.mean(each)) for name, each in totals.items()}


def read_run(folder: Path) -> TrainingRun:
    """The run in a folder. Raises InvalidInput for one without an evaluation."""
    for name in (CONFIG, RULES, CURVE):
        if not (folder / name).is_file():
            raise InvalidInput(f"{folder} holds no evaluated training run: no {name}")
    run = TrainingRun(
        read_config(folder / CONFIG),
        read_rules(folder / RULES),
        read_curve(folder / CURVE),
        read_episodes(folder),
    )
    if not run.curve:
        raise InvalidInput(f"{folder} holds no evaluated training run: {CURVE} has no evaluation")
    return run


def grouped_runs(runs: Iterable[TrainingRun]) -> list[list[TrainingRun]]:
    """The runs of every recipe, in the order of the first."""
    groups: dict[str, list[TrainingRun]] = {}
    for run in runs:
        groups.setdefault(run.recipe, []).append(run)
    return list(groups.values())


def shared_steps(runs: Sequence[TrainingRun]) -> list[int]:
    """Environment steps at which all runs were evaluated, ascending."""
    return sorted(set.intersection(*(set(run.steps) for run in runs)))


def scores_at(runs: Sequence[TrainingRun], steps: int) -> Floats:
    """(runs, tasks) the scores of all runs after so many steps. Raises InvalidInput for runs that
    were scored in different environments.
    """
    if any(run.tasks != runs[0].tasks for run in runs):
        raise InvalidInput(
            "runs of one recipe were scored in different environments: "
            + "; ".join(", ".join(run.tasks) or "none" for run in runs)
        )
    return np.array([run.scores[run.steps.index(steps)] for run in runs])


def recipe_name(config: Mapping[str, Any]) -> str:
    """The learner, its environments, whether episodes were drawn, and what was left out."""
    named = Counter(np.atleast_1d(config["env"]).tolist())
    envs = ", ".join(f"{env} x{often}" if often > 1 else env for env, often in named.items())
    without = " ".join(config.get("without", ()))
    drawn = ", drawn" if config.get("drawn") else ""
    return f"{config['algorithm']}, {envs}{drawn}" + (f", without {without}" if without else "")
