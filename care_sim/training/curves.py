"""Learning curves of training runs, read from their folders and grouped.

Runs of a group differ by their seed alone.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.training.config import HOW_LONG
from care_sim.training.folder import (
    CONFIG,
    CURVE,
    RULES,
    Evaluation,
    read_config,
    read_curve,
    read_rules,
)


@dataclass(frozen=True)
class TrainingRun:
    """A run: its configuration, what rules score on its validation seeds, and its evaluations."""

    config: Mapping[str, Any]
    rules: Mapping[str, Mapping[str, float]]
    curve: Sequence[Evaluation]

    @property
    def recipe(self) -> str:
        """What is the same in all runs of a panel: the configuration without seed and length."""
        return json.dumps(
            {name: self.config[name] for name in self.config if name not in ("seed", *HOW_LONG)}
        )

    @property
    def closed_loop(self) -> bool:
        """Whether a first detection has a distance; the return alone is measured otherwise."""
        return all(distance is not None for *_, distance in self.curve)

    @property
    def marks(self) -> dict[str, float]:
        """What the rules reach by name, measured as `values`."""
        scores = self.rules.items()
        return {
            name: s["mean_return"] if s["distance_m"] is None else s["distance_m"]
            for name, s in scores
        }

    @property
    def steps(self) -> list[int]:
        """Environment steps at each evaluation."""
        return [steps for steps, *_ in self.curve]

    @property
    def values(self) -> list[float]:
        """What is drawn of the evaluations: metres of the first detection, or the return."""
        return [value if distance is None else distance for _, _, value, distance in self.curve]


def read_run(folder: Path) -> TrainingRun:
    """The run in a folder. Raises InvalidInput for one without an evaluation."""
    for name in (CONFIG, RULES, CURVE):
        if not (folder / name).is_file():
            raise InvalidInput(f"{folder} holds no evaluated training run: no {name}")
    run = TrainingRun(
        read_config(folder / CONFIG), read_rules(folder / RULES), read_curve(folder / CURVE)
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
