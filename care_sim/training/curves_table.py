"""The table of learning curves: what every recipe reached, how soon, and in how long."""

from collections.abc import Sequence

import numpy as np

from care_sim.reports.table import Table
from care_sim.study.progress import rounded_duration
from care_sim.training.aggregates import interquartile_mean
from care_sim.training.curves import TrainingRun, recipe_name, scores_at, shared_steps

COLUMNS = ("recipe", "seeds", "steps", "reached", "unit", "ahead of", "time")


def curves_table(groups: Sequence[Sequence[TrainingRun]]) -> Table:
    """A row per recipe."""
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
    seconds = [dict(zip(run.steps, (row[1] for row in run.curve), strict=True)) for run in runs]
    return (
        name,
        seeds,
        f"{shared[-1]:,}",
        str(reached[-1]),
        runs[0].unit,
        _ahead(runs, shared, [one.value for one in reached]),
        rounded_duration(float(np.median([each[shared[-1]] for each in seconds]))),
    )


def _ahead(runs: Sequence[TrainingRun], steps: Sequence[int], reached: Sequence[float]) -> str:
    """The rules that are left behind for good, and from when on."""
    told = []
    for rule, scores in runs[0].marks.items():
        mark = interquartile_mean(scores[None]).value
        # The last evaluation that is not above the rule; before the first one there is none.
        behind = max((n for n, value in enumerate(reached) if value <= mark), default=-1)
        if behind + 1 < len(steps):
            told.append(f"{rule} from {steps[behind + 1]:,}")
    return ", ".join(told) or "none"
