"""Whether five training seeds of `ppo` without a part differ from five with all by more than luck.

    python docs/examples/deal_seeds.py

Reads the published runs and plays. p is the chance, over all ways to deal the ten runs into two
fives, that the means of the fives lie as far apart (exact permutation test, Fisher 1935).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import permutation_test

from care_sim.study.rows.parquet import read_rows
from care_sim.training.curves import read_run

RESULTS = Path(__file__).parents[2] / "results"
WITH_ALL = [f"drawn-{seed}" for seed in range(5)]
STREETS = "streets/plays.parquet"
HEAD = "| {} | with all | without | p |\n|---|---|---|---|"


def without(part: str) -> list[str]:
    """The runs without a part; that of seed 0 has no number."""
    return [f"drawn-without-{part}", *(f"drawn-without-{part}-{seed}" for seed in range(1, 5))]


def line(name: str, *fives: Sequence[float] | np.ndarray, digits: int = 1) -> str:
    """A row of a table: mean, least and most of both fives, and p."""
    cells = [f"{np.mean(x):.{digits}f} ({min(x):.{digits}f}, {max(x):.{digits}f})" for x in fives]
    p = permutation_test(fives, lambda a, b: np.mean(a) - np.mean(b)).pvalue
    return f"| {name} | {' | '.join(cells)} | {p:.2f} |"


def scores(runs: Sequence[str]) -> list[float]:
    """Of each on its validation seeds at the end, the mean over tests, streets and drives."""
    return [read_run(RESULTS / "training" / run).scores[-1].mean() for run in runs]


def sums(runs: Sequence[str], table: str, column: str, budget: float) -> np.ndarray:
    """(runs,) of a column, over the episodes or plays of each on test seeds at a budget."""
    rows = [
        row
        for place in ("drawn-ppo", "without-pictures")
        for row in read_rows(RESULTS / f"{place}-{table}")
    ]
    paths = [f"results/training/{run}/weights.npz" for run in runs]
    return np.array(
        [
            sum(
                row[column]
                for row in rows
                if row.get("policy.path") == path and row["budget"] == budget
            )
            for path in paths
        ]
    )


def main() -> None:
    """Print what every part is worth in the validation, and the pictures on test seeds."""
    print(HEAD.format("mean score at the end"))
    for part in ("faults", "pictures", "place", "tracks"):
        print(line(f"without {part}", scores(WITH_ALL), scores(without(part)), digits=2))
    print("\n" + HEAD.format("test seeds, pictures"))
    fives = WITH_ALL, without("pictures")
    for name, found, of in (
        ("first sightings", "sighted", "events"),
        ("overall recall", "found", "frames"),
    ):
        for budget in (0.01, 0.02, 0.03, 0.1):
            shares = (
                100 * sums(runs, STREETS, found, budget) / sums(runs, STREETS, of, budget)
                for runs in fives
            )
            print(line(f"{name}, {budget:.0%}", *shares))
    for budget in (0.01, 0.03):
        hits = (sums(runs, "drive/episodes.parquet", "collision", budget) for runs in fives)
        print(line(f"collisions of 40 drives, {budget:.0%}", *hits))


if __name__ == "__main__":
    main()
