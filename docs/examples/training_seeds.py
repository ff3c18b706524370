"""What the training seeds of `ppo` in worlds that vary tell: the tables of its page.

    python docs/examples/training_seeds.py

Reads the published runs and plays. p is the chance, over all ways to deal ten runs into two fives,
that the means of the fives lie at least as far apart (the exact permutation test of SciPy).
"""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import permutation_test

from care_sim.evaluation.bootstrap import ratio_of_sums
from care_sim.study.rows.parquet import read_rows
from care_sim.study.run_config import Row
from care_sim.training.aggregates import interquartile_mean
from care_sim.training.curves import TrainingRun, read_run

RESULTS = Path(__file__).parents[2] / "results"
WITH_ALL = [f"drawn-{seed}" for seed in range(5)]
PARTS = ("faults", "pictures", "place", "tracks")
STREETS, DRIVES = "streets/plays.parquet", "drive/episodes.parquet"
SEEING, BLIND = ("drawn-ppo", "without-pictures"), ("blind-ppo",)
BUDGETS = (0.01, 0.02, 0.03, 0.1)
TASKS = ("CARE-NCAP-v0", "CARE-Street-v0", "CARE-Drive-v0")
HEAD = "| {} | with all | without | p |\n|---|---|---|---|"


def without(part: str) -> list[str]:
    """The runs without a part; that of seed 0 has no number."""
    return [f"drawn-without-{part}", *(f"drawn-without-{part}-{seed}" for seed in range(1, 5))]


@cache
def run(name: str) -> TrainingRun:
    """A published run."""
    return read_run(RESULTS / "training" / name)


@cache
def rows(studies: Sequence[str], table: str) -> list[Row]:
    """The rows of studies on test seeds."""
    return [row for study in studies for row in read_rows(RESULTS / f"{study}-{table}")]


def rows_of(name: str, studies: Sequence[str], table: str, budget: float) -> list[Row]:
    """Those of a run at a budget, by world. Raises SystemExit where there are none."""
    path = f"results/training/{name}/weights.npz"
    found = [
        row
        for row in rows(studies, table)
        if (row.get("policy.path"), row["budget"]) == (path, budget)
    ]
    if not found:
        raise SystemExit(f"no rows of {path} at {budget:.0%} in {', '.join(studies)}")
    return sorted(found, key=lambda row: (row.get("scene", ""), row.get("seed", 0)))


def total(name: str, table: str, column: str, budget: float) -> float:
    """The sum of a column over a run's worlds."""
    return sum(row[column] for row in rows_of(name, SEEING, table, budget))


def marks_table() -> list[str]:
    """What rules reach on the validation seeds, in the learner's score."""
    marks = {
        name: interquartile_mean(scores[None]).value
        for name, scores in run(WITH_ALL[0]).marks.items()
    }
    ordered = sorted(marks, key=lambda name: marks[name])
    cells = [f"{marks[name]:.2f}" for name in ordered]
    return [f"| {' | '.join(ordered)} |", "|---" * len(ordered) + "|", f"| {' | '.join(cells)} |"]


def spread(scores: Sequence[float] | np.ndarray, middle: Callable, digits: int) -> str:
    """Mean or median, least and most."""
    return "{:.{d}f} ({:.{d}f}, {:.{d}f})".format(
        middle(scores), min(scores), max(scores), d=digits
    )


def recipes_table() -> list[str]:
    """Of every recipe the score at the end, by environment and in all."""
    lines = [
        "| score at the end, median of five seeds (least, most) | tests | streets | drives "
        "| interquartile mean |",
        "|---|---|---|---|---|",
    ]
    for name, runs in [("with all", WITH_ALL), *((f"without {p}", without(p)) for p in PARTS)]:
        last = np.array([run(one).scores[-1] for one in runs])
        places = [run(runs[0]).tasks.index(task) for task in TASKS]
        cells = [spread(last[:, place], np.median, 2) for place in places]
        lines.append(f"| {name} | {' | '.join(cells)} | {interquartile_mean(last)} |")
    return lines


def line(name: str, *fives: Sequence[float] | np.ndarray, digits: int = 1) -> str:
    """A row of a table: mean, least and most of both fives, and p."""
    p = permutation_test(fives, lambda a, b: np.mean(a) - np.mean(b)).pvalue
    return f"| {name} | {' | '.join(spread(x, np.mean, digits) for x in fives)} | {p:.2f} |"


def scores_table() -> list[str]:
    """What every part is worth in the validation."""
    fives = [
        (part, [[run(one).scores[-1].mean() for one in runs] for runs in (WITH_ALL, without(part))])
        for part in PARTS
    ]
    return [HEAD.format("mean score at the end")] + [
        line(f"without {part}", *scores, digits=2) for part, scores in fives
    ]


def pictures_table() -> list[str]:
    """What the pictures are worth on test seeds."""
    fives = WITH_ALL, without("pictures")
    lines = [HEAD.format("test seeds, pictures")]
    for name, found, of in (
        ("first sightings", "sighted", "events"),
        ("overall recall", "found", "frames"),
    ):
        for budget in BUDGETS:
            shares = (
                [
                    100 * total(r, STREETS, found, budget) / total(r, STREETS, of, budget)
                    for r in five
                ]
                for five in fives
            )
            lines.append(line(f"{name}, {budget:.0%}", *shares))
    for budget in (0.01, 0.03):
        hits = ([total(r, DRIVES, "collision", budget) for r in five] for five in fives)
        lines.append(line(f"collisions of 40 drives, {budget:.0%}", *hits))
    return lines


def blind_table() -> list[str]:
    """What the runs with all find with a camera that misses everything, less what they find with
    one that sees, points of first sightings, paired by street.
    """
    lines = [
        f"| blind less seeing | {' | '.join(f'{budget:.0%}' for budget in BUDGETS)} |",
        "|---" * (len(BUDGETS) + 1) + "|",
    ]
    for name in WITH_ALL:
        cells = []
        for budget in BUDGETS:
            seeing, blind = (rows_of(name, s, STREETS, budget) for s in (SEEING, BLIND))
            pairs = list(zip(blind, seeing, strict=True))
            lead = ratio_of_sums(
                (
                    [100 * (a["sighted"] - b["sighted"]) for a, b in pairs],
                    [a["events"] for a, _ in pairs],
                )
            )
            found = 100 * sum(a["sighted"] for a in blind) / sum(a["events"] for a in blind)
            cells.append("{:.1f}: {:+.1f} [{:.1f}, {:.1f}]".format(found, *lead))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Print them."""
    tables = (marks_table, recipes_table, scores_table, pictures_table, blind_table)
    print("\n\n".join("\n".join(table()) for table in tables))


if __name__ == "__main__":
    main()
