"""Learning curves of training runs, read from their folders and grouped.

Runs of a group differ only by their seed. Statistics over seeds follow Agarwal et al. 2021, "Deep
reinforcement learning at the edge of the statistical precipice". Scores are (runs, tasks).
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.reports.table import Table
from care_sim.study.progress import rounded_duration
from care_sim.training.config import HOW_LONG
from care_sim.training.folder import CONFIG, CURVE, EPISODES, LEARNER, read_config, read_table
from care_sim.training.validation import Row

NOTHING, EVERYTHING = "random", "full"
"""Rules with scores 0 and 1, for scores across environments."""
COLUMNS = ("recipe", "seeds", "steps", "reached", "unit", "ahead of", "time")
RESAMPLES = 2_000
"""Resamples of an interval."""
CONFIDENCE = 0.95
_CUT = 0.25
"""Share of the scores that is left out at either end."""


@dataclass(frozen=True)
class TrainingRun:
    """A run: its configuration, its evaluations, and the episodes of these and of the rules."""

    config: Mapping[str, Any]
    curve: Sequence[Row]
    episodes: Sequence[Row]

    @property
    def recipe(self) -> str:
        """Return what all runs of a panel share: the configuration without seed and length."""
        left_out = ("seed", *HOW_LONG)
        return json.dumps(
            {name: told for name, told in self.config.items() if name not in left_out},
            sort_keys=True,
        )

    @property
    def closed_loop(self) -> bool:
        """Whether a first detection has a distance; otherwise only the return is measured."""
        return all(row["distance_m"] is not None for row in self.episodes)

    @property
    def unit(self) -> str:
        """Return the unit of the scores."""
        if len(self.tasks) > 1:
            return f"score ({NOTHING} 0, {EVERYTHING} 1)"
        return "first detection (m; 0 if never)" if self.closed_loop else "return"

    @cached_property
    def tasks(self) -> list[str]:
        """Return the environments that are scored separately. One that `NOTHING` plays as well as
        `EVERYTHING` is left out, unless it is the only one.
        """
        names = [*dict.fromkeys(row["env"] for row in self.episodes)]
        if len(names) == 1:
            return names
        low, high = (self._means.get((rule, 0), {}) for rule in (NOTHING, EVERYTHING))
        return [name for name in names if name in low and low[name] < high.get(name, -np.inf)]

    @property
    def rules(self) -> list[str]:
        """Return the rules that are compared with the learner."""
        return [*dict.fromkeys(row["policy"] for row in self.episodes if row["policy"] != LEARNER)]

    @property
    def steps(self) -> list[int]:
        """Environment steps at each evaluation."""
        return [row["steps"] for row in self.curve]

    def scores(self, policy: str = LEARNER, steps: int = 0) -> Floats:
        """Return (tasks,) scores. For one environment: metres of the first detection, or the
        return. For several: the return, scaled from `NOTHING` to `EVERYTHING`, without unit. Raises
        InvalidInput if episodes are missing.
        """
        if len(self.tasks) > 1:
            low, high, reached = (
                self._returns(*one) for one in ((NOTHING, 0), (EVERYTHING, 0), (policy, steps))
            )
            return np.asarray((reached - low) / (high - low))
        if len(own := self.each(policy, steps)):
            return np.array([np.mean(own)])
        raise self._missing(policy, steps)

    def each(self, policy: str, steps: int = 0) -> Floats:
        """Return (episodes,) a policy's result in every episode, by ascending seed. The unit is
        that of `scores` for one environment; for several it is the return.
        """
        column = "distance_m" if len(self.tasks) < 2 and self.closed_loop else "return"
        rows = sorted(
            (row["seed"], row[column])
            for row in self.episodes
            if (row["policy"], row["steps"]) == (policy, steps)
        )
        return np.array([value for _, value in rows])

    def _returns(self, policy: str, steps: int) -> Floats:
        means = self._means.get((policy, steps), {})
        if not {*self.tasks} <= {*means}:
            raise self._missing(policy, steps)
        return np.array([means[task] for task in self.tasks])

    def _missing(self, policy: str, steps: int) -> InvalidInput:
        return InvalidInput(
            f"the episodes of a run of seed {self.config.get('seed')} lack some of {policy} after "
            f"{steps} steps"
        )

    @cached_property
    def _means(self) -> dict[tuple[str, int], dict[str, float]]:
        """The mean return of a policy after so many steps, by environment."""
        totals: dict[tuple[str, int], dict[str, list[float]]] = {}
        for row in self.episodes:
            played = totals.setdefault((row["policy"], row["steps"]), {})
            played.setdefault(row["env"], []).append(row["return"])
        return {
            which: {env: float(np.mean(each)) for env, each in played.items()}
            for which, played in totals.items()
        }


def read_run(folder: Path) -> TrainingRun:
    """Return the run in a folder. Raises InvalidInput for one without an evaluation."""
    for name in (CONFIG, CURVE, EPISODES):
        if not (folder / name).is_file():
            raise InvalidInput(f"{folder} holds no evaluated training run: no {name}")
    run = TrainingRun(
        read_config(folder / CONFIG), read_table(folder / CURVE), read_table(folder / EPISODES)
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
    return np.array([run.scores(steps=steps) for run in runs])


def recipe_name(config: Mapping[str, Any]) -> str:
    """Return a recipe's name: the learner, its environments, whether episodes were drawn, and
    omitted parts.
    """
    named = Counter(np.atleast_1d(config["env"]).tolist())
    envs = ", ".join(f"{env} x{often}" if often > 1 else env for env, often in named.items())
    without = " ".join(config.get("without", ()))
    drawn = ", drawn" if config.get("drawn") else ""
    return f"{config['algorithm']}, {envs}{drawn}" + (f", without {without}" if without else "")


class Aggregate(NamedTuple):
    """A number over all runs, and the ends of its interval, which are None for a single run."""

    value: float
    low: float | None
    high: float | None

    def __str__(self) -> str:
        if self.low is None or self.high is None:
            return f"{self.value:.2f}"
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def interquartile_mean(scores: ArrayLike) -> Aggregate:
    """Return the mean of the middle half of all finite scores (runs, tasks). The interval is that
    of the stratified bootstrap. In every task the runs are drawn with replacement, independently of
    other tasks, so that every resample has all tasks.
    """
    table: Floats = np.asarray(scores, float)
    return Aggregate(float(_middle(table.ravel())), *_ends(table, _middle))


def performance_profile(scores: ArrayLike, levels: ArrayLike) -> list[Aggregate]:
    """Return the share of scores (runs, episodes) above each of `levels`. The interval is that of
    the bootstrap over whole runs: a run plays all episodes, and differences between runs show in
    all of them. Drawn per episode, runs would cancel, and the interval would vanish with more
    episodes.
    """
    table: Floats = np.asarray(scores, float)
    shares = [
        (table > level).mean(axis=1, keepdims=True)
        for level in np.atleast_1d(np.asarray(levels, float))
    ]
    return [Aggregate(float(each.mean()), *_ends(each, _mean)) for each in shares]


def _middle(scores: Floats) -> Floats:
    result: Floats = np.asarray(stats.trim_mean(scores, _CUT, axis=-1))
    return result


def _mean(scores: Floats) -> Floats:
    result: Floats = np.asarray(scores.mean(axis=-1))
    return result


def _ends(
    table: Floats, statistic: Callable[[Floats], Floats]
) -> tuple[float, float] | tuple[None, None]:
    """Return the ends of the interval of a statistic of all scores, taken along the last axis."""
    if len(table) < 2:
        return None, None
    interval = stats.bootstrap(
        tuple(table.T),
        lambda *tasks, axis: statistic(
            np.concatenate([np.moveaxis(task, axis, -1) for task in tasks], axis=-1)
        ),
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


def curves_table(groups: Sequence[Sequence[TrainingRun]]) -> Table:
    """Return a row per recipe: its result, and its steps and time."""
    return Table(
        "Training runs",
        COLUMNS,
        tuple(map(_row, groups)),
        notes=(
            "reached: interquartile mean of training seeds and environments at the last evaluation "
            "that all runs of a recipe have, no chosen one; of two seeds or more with the interval "
            "of a stratified bootstrap, 95%.",
            "ahead of: rules, and the steps from which on that mean stays above them.",
            "time: the median of a run's learning, evaluations left out, on the machine and under "
            "the load that it had.",
        ),
    )


def _row(runs: Sequence[TrainingRun]) -> tuple[str, ...]:
    shared = shared_steps(runs)
    name, seeds = recipe_name(runs[0].config), str(len(runs))
    if not shared:
        return name, seeds, "-", "-", runs[0].unit, "-", "-"
    reached = [interquartile_mean(scores_at(runs, steps)) for steps in shared]
    seconds = [row["seconds"] for run in runs for row in run.curve if row["steps"] == shared[-1]]
    return (
        name,
        seeds,
        f"{shared[-1]:,}",
        str(reached[-1]),
        runs[0].unit,
        _ahead(runs[0], shared, [one.value for one in reached]),
        rounded_duration(float(np.median(seconds))),
    )


def _ahead(run: TrainingRun, steps: Sequence[int], reached: Sequence[float]) -> str:
    """Return the rules that the learner finally exceeds, and the steps from which it does."""
    told = []
    for rule in run.rules:
        mark = interquartile_mean(run.scores(rule)[None]).value
        # The last evaluation that is not above the rule; before the first one there is none.
        behind = max((n for n, value in enumerate(reached) if value <= mark), default=-1)
        if behind + 1 < len(steps):
            told.append(f"{rule} from {steps[behind + 1]:,}")
    return ", ".join(told) or "none"
