"""Statements "A needs fewer cells than B", and under which detectors they hold.

Each detector gives the paired ratio of the two B90 on the same worlds, with an interval over
worlds. Under a detector the statement holds where the interval is below 1, the opposite holds where
it is above 1, and otherwise the two are tied. Over the detectors the statement is

- *under all*: it holds under each;
- *under most*: it holds under more than half, and the opposite under none;
- *turns over*: it holds under some, and the opposite under others;
- *tied*: none of these.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from care_sim.base.errors import counted
from care_sim.evaluation.smallest_budget import budget_ratio, has_interval
from care_sim.reports.budgets import (
    NOTE,
    format_ratio,
    format_smallest,
    sorted_by_budget,
    worlds_of,
)
from care_sim.reports.table import Table
from care_sim.study.benchmark.budgets import BudgetResult

UNDER_ALL, UNDER_MOST, TURNS_OVER, TIED = "under all", "under most", "turns over", "tied"
Columns = Mapping[str, Sequence[BudgetResult]]
"""The results under each detector by its name, the main detector first. A detector has each entry
once, and all entries in the same worlds."""
Pair = tuple[str, str]
"""The names of two entries."""
QUESTIONS: tuple[Pair, ...] = (
    ("care-aimed", "care-sector"),
    ("care-sector", "care-sector residual=False"),
    ("care-sector", "tuned-place"),
    ("care-sector", "after-ancha"),
    ("care core-spread", "all-camera core-spread"),
    ("care", "rows"),
    ("care-sightlines", "learned-sets"),
    ("tuned-place", "learned-sets"),
)
"""Pairs that differ in one idea: the residual, the camera, the paper's rule, learning."""
_NOTE = (
    "Ratios are the first policy's B90 by the second's, paired over the same worlds. Bold ratios "
    "exclude 1. No interval is widened for the number of statements."
)


@dataclass(frozen=True)
class Statement:
    """Two entries, and the detectors under which the first needs `fewer` cells than the second,
    under which `more`, and under which the two are `tied`.
    """

    first: str
    second: str
    fewer: tuple[str, ...]
    more: tuple[str, ...]
    tied: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """One of the four words of this module."""
        if self.fewer and self.more:
            return TURNS_OVER
        if self.fewer and not self.tied:
            return UNDER_ALL
        return UNDER_MOST if len(self.fewer) > len(self.tied) else TIED

    def __str__(self) -> str:
        named = {"fewer": self.fewer, "more": self.more, "tied": self.tied}
        told = [f"{word} under {', '.join(own)}" for word, own in named.items() if own]
        # A single list of detectors says no more than the verdict.
        return self.verdict if len(told) == 1 else f"{self.verdict}: {'; '.join(told)}"


def statement(columns: Columns, first: str, second: str) -> Statement:
    """Compare two entries under each detector. The entry that needs fewer cells under more
    detectors becomes the first.
    """
    found: dict[str, list[str]] = {"fewer": [], "more": [], "tied": []}
    for detector, results in columns.items():
        ours, theirs = (_named(results, name).counts for name in (first, second))
        _, low, high = budget_ratio(ours, theirs) if has_interval(ours) else (1.0, 0.0, np.inf)
        found["fewer" if high < 1 else "more" if low > 1 else "tied"].append(detector)
    fewer, more, tied = map(tuple, found.values())
    if len(more) > len(fewer):
        return Statement(second, first, more, fewer, tied)
    return Statement(first, second, fewer, more, tied)


def statements_table(
    columns: Columns, pairs: Iterable[Pair] = QUESTIONS, kind: str = "detector"
) -> Table:
    """Return a table with a line per statement: of those `pairs` that played, then of neighbours in
    the ranking under the first detector. The columns may be results of another `kind`.
    """
    alike = _in_common(columns)
    main, *_ = alike.values()
    ranking = [one.entry.name for one in sorted_by_budget(main)]
    known = [pair for pair in pairs if {*pair} <= {*ranking}]
    asked = {frozenset(pair): pair for pair in (*known, *pairwise(ranking))}
    rows = []
    for pair in asked.values():
        told = statement(alike, *pair)
        ratios = (
            format_ratio(*(_named(own, name) for name in (told.first, told.second)))
            for own in alike.values()
        )
        rows.append((told.first, told.second, str(told), *ratios))
    return Table(
        f"Pairs of policies, under {counted(len(alike), kind)}, {worlds_of(main[0])}",
        ("policy", "needs fewer cells than", "holds", *alike),
        tuple(rows),
        (_NOTE,),
        names=2,
    )


def columns_table(columns: Columns) -> Table:
    """Return a table with a line per entry and its B90 under each detector."""
    alike = _in_common(columns)
    main, *_ = alike.values()
    names = [one.entry.name for one in sorted_by_budget(main)]
    rows = (
        (name, *(format_smallest(_named(results, name)) for results in alike.values()))
        for name in names
    )
    return Table(
        f"B90 under each detector, {worlds_of(main[0])}",
        ("policy", *alike),
        tuple(rows),
        (NOTE,),
    )


def _named(results: Sequence[BudgetResult], name: str) -> BudgetResult:
    return next(one for one in results if one.entry.name == name)


def _in_common(columns: Columns) -> dict[str, list[BudgetResult]]:
    """Return the results of the entries and in the worlds that all detectors have."""
    (first, *_), *others = columns.values()
    held = set(first.worlds).intersection(*(results[0].worlds for results in others))
    worlds = [world for world in first.worlds if world in held]
    names = set.intersection(*({one.entry.name for one in own} for own in columns.values()))
    return {
        detector: [cut for one in own if one.entry.name in names and (cut := one.cut_to(worlds))]
        for detector, own in columns.items()
    }
