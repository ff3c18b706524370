"""The rows of a study of the Euro NCAP tests: how each ended, and scores of tests and in all."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import check_known
from care_sim.evaluation.censoring import Reading, difference
from care_sim.evaluation.collision_outcomes import CollisionOutcome, collision_outcome
from care_sim.evaluation.ncap_score import score
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.controls import best_control, is_control
from care_sim.reports.engine.measures import Measure
from care_sim.reports.formatting import marked
from care_sim.scenarios.ncap.forms import Ahead
from care_sim.scenarios.ncap.table import TESTS
from care_sim.study.designs.ncap import (
    REPORTED_COLUMN,
    SPEED_COLUMN,
    TARGET_COLUMN,
    TEST_COLUMN,
)
from care_sim.study.rows.reading import policy_of, stops_for_nothing, tags_of_row
from care_sim.study.run_config import FULL, Row

READINGS = {True: "reported", False: "unreported"}
"""Whether perception reports the cars that hide the target, in words."""
_SCORE = Measure("Score", "points", 2, math.inf, lambda row: Reading(score(*impact_of(row))))


@dataclass(frozen=True)
class Line:
    """A test in one reading; `reported` is None where no cars hide the target."""

    test: str
    reported: bool | None

    @property
    def label(self) -> str:
        """A name for people."""
        return self.test if self.reported is None else f"{self.test} {READINGS[self.reported]}"

    def holds(self, reading: bool) -> bool:
        """Whether it counts where the cars are reported, or are not."""
        return self.reported is None or self.reported == reading


Case = tuple[Line, float, float]
"""Line, speed of the ego and of the target in km/h."""
Scores = Mapping[tuple[int, Case], float]
"""By seed and case."""
Contender = tuple[str, float]
"""Policy and budget."""


def impact_of(row: Row) -> tuple[float | None, float]:
    """The speed of a row's impact (None without one), and that of a car that does not brake, m/s.

    On a target that goes ahead at an even speed it is the speed of closing, else the ego's own. A
    stop for nothing counts as a car that does not brake.
    """
    check_known("test", row[TEST_COLUMN], TESTS)
    ahead = isinstance(TESTS[row[TEST_COLUMN]].way, Ahead)
    lead = row[TARGET_COLUMN] / 3.6 if ahead else 0.0
    reference = row[SPEED_COLUMN] / 3.6 - lead
    if stops_for_nothing(row):
        return reference, reference
    impact = row["impact_speed_mps"]
    return (None if impact is None else impact - lead), reference


class NcapRows:
    """The rows of a study, by policy and budget."""

    def __init__(self, rows: Sequence[Row]):
        self.tags = {policy_of(row): tags_of_row(row) for row in rows}
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        order = {name: number for number, name in enumerate(TESTS)}
        self.lines = sorted(
            {_line(row) for row in rows},
            key=lambda line: (order[line.test], line.reported is False),
        )
        # The full scan first.
        self.policies = sorted(self.tags, key=lambda name: name != FULL)
        self.speeds = sorted({row[SPEED_COLUMN] for row in rows})
        """The ego's speeds, km/h."""
        self._endings: dict[Contender, list[tuple[Line, CollisionOutcome]]] = {}
        self._scores: dict[Contender, dict[tuple[int, Case], float]] = {}
        for row in rows:
            contender = policy_of(row), row["budget"]
            ending = _line(row), collision_outcome(*impact_of(row))
            self._endings.setdefault(contender, []).append(ending)
            scores = self._scores.setdefault(contender, {})
            scores[row["seed"], _case(row)] = score(*impact_of(row))

    def contender(self, policy: str, budget: float) -> Contender:
        """What was played of a policy beside others at a budget: the full scan has one of its
        own.
        """
        return policy, 1.0 if policy == FULL else budget

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags[policy])

    def endings(self, contender: Contender, lines: Iterable[Line]) -> Counter[CollisionOutcome]:
        """How the episodes of some lines ended."""
        held = set(lines)
        return Counter(end for line, end in self._endings.get(contender, ()) if line in held)

    def scores(self, contender: Contender, lines: Iterable[Line]) -> Scores:
        """The scores of some lines."""
        held = set(lines)
        own = self._scores.get(contender, {})
        return {key: value for key, value in own.items() if key[1][0] in held}

    def reading(self, reported: bool) -> list[Line]:
        """The lines of a reading, with those without cars that hide."""
        return [line for line in self.lines if line.holds(reported)]

    @property
    def readings(self) -> list[bool]:
        """Which readings were played; one where no test has cars that hide."""
        played = {line.reported for line in self.lines} - {None}
        return [reading for reading in READINGS if reading in played] or [True]

    def best_control(self, budget: float, lines: Sequence[Line]) -> str | None:
        """The control of the best score at a budget."""
        controls = [name for name in self.policies if is_control(self.tags[name])]
        scores = {name: self.scores((name, budget), lines) for name in controls}
        return best_control({n: overall(own) for n, own in scores.items() if own})

    def difference(
        self, ours: Contender, theirs: Contender, lines: Sequence[Line]
    ) -> Contrast | None:
        """The score of one contender less that of another, paired by seed; None without shared
        seeds.
        """
        a, b = self.scores(ours, lines), self.scores(theirs, lines)
        # In the order of the rows, so that sums have the same last bits.
        shared = [key for key in a if key in b]
        seeds = sorted({seed for seed, _ in shared})
        if not seeds:
            return None
        pairs = [
            [
                Reading(overall({key: one[key] for key in shared if key[0] == seed}))
                for seed in seeds
            ]
            for one in (a, b)
        ]
        return Contrast(_SCORE, difference(*pairs))


def overall(scores: Scores) -> float:
    """The mean over tests of the means over their speeds and seeds: every test weighs the same."""
    by_line: dict[Line, list[float]] = {}
    for (_, (line, _, _)), value in scores.items():
        by_line.setdefault(line, []).append(value)
    return float(np.mean([np.mean(own) for own in by_line.values()]))


def _line(row: Row) -> Line:
    return Line(row[TEST_COLUMN], row.get(REPORTED_COLUMN))


def _case(row: Row) -> Case:
    return _line(row), row[SPEED_COLUMN], row[TARGET_COLUMN]
