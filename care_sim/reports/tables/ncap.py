"""The Euro NCAP tests: outcomes by test and in all, and differences in scores."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.checks import check_known
from care_sim.base.errors import percent
from care_sim.evaluation.censoring import Reading
from care_sim.evaluation.outcomes import CollisionOutcome, collision_outcome, score
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.controls import BEST_CONTROL, best_of
from care_sim.reports.engine.measures import Measure, Units
from care_sim.reports.engine.parts import PolicyRows
from care_sim.reports.engine.tables import under_headings
from care_sim.reports.formatting import interval, tag_notes
from care_sim.reports.table import Table, TableRow
from care_sim.scenarios.ncap.table import TESTS, Ahead
from care_sim.study.designs import standards as design
from care_sim.study.rows.reading import stops_for_nothing
from care_sim.study.run_config import FULL, REFERENCE, Row

_READINGS = {True: "reported", False: "unreported"}
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
        return self.test if self.reported is None else f"{self.test} {_READINGS[self.reported]}"


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
    test, ego_kph, target_kph = (
        row[name] for name in (design.TEST_COLUMN, design.SPEED_COLUMN, design.TARGET_COLUMN)
    )
    check_known("test", test, TESTS)
    lead = target_kph / 3.6 if isinstance(TESTS[test].way, Ahead) else 0.0
    reference = ego_kph / 3.6 - lead
    if stops_for_nothing(row):
        return reference, reference
    impact = row["impact_speed_mps"]
    return (None if impact is None else impact - lead), reference


class NcapRows(PolicyRows):
    """The rows of a study, by policy and budget."""

    def __init__(self, rows: Sequence[Row]):
        super().__init__(rows)
        self.speeds = sorted({row[design.SPEED_COLUMN] for row in rows})
        """The ego's speeds, km/h."""
        order = [*TESTS]
        self.lines = sorted(
            {_case(row)[0] for row in rows},
            key=lambda line: (order.index(line.test), line.reported is False),
        )

    @property
    def policies(self) -> list[str]:
        """Their names, the full scan first."""
        return sorted(self.tags, key=lambda name: name != FULL)

    def contender(self, policy: str, budget: float) -> Contender:
        """Return the rows of a policy beside others at a budget: the full scan has one of its
        own.
        """
        return policy, 1.0 if policy == FULL else budget

    def scores(self, contender: Contender, lines: Iterable[Line]) -> Scores:
        """The scores of some lines."""
        placed = ((row["seed"], _case(row), row) for row in self.of(*contender))
        return {
            (seed, case): score(*impact_of(row)) for seed, case, row in placed if case[0] in lines
        }

    def endings(self, contender: Contender, lines: Iterable[Line]) -> Counter[CollisionOutcome]:
        """How the episodes of some lines ended."""
        rows = (row for row in self.of(*contender) if _case(row)[0] in lines)
        return Counter(collision_outcome(*impact_of(row)) for row in rows)

    @property
    def parts(self) -> dict[str, list[Line]]:
        """The lines in all, by reading where both were played: each with the tests that no cars
        hide.
        """
        readings = [each for each in _READINGS if each in {line.reported for line in self.lines}]
        return {
            f"in all, cars {_READINGS[reading]}" if len(readings) > 1 else "in all": [
                line for line in self.lines if line.reported in (None, reading)
            ]
            for reading in readings or [True]
        }

    def best_control(self, budget: float, lines: Sequence[Line]) -> str | None:
        """The control of the best score at a budget."""
        scores = {name: self.scores((name, budget), lines) for name in self.controls}
        return best_of(_SCORE, {name: _by_seed(own, own) for name, own in scores.items()})

    def difference(
        self, ours: Contender, theirs: Contender, lines: Sequence[Line]
    ) -> Contrast | None:
        """The score of one contender less that of another, paired by seed, of the cases that both
        have; None without any.
        """
        a, b = self.scores(ours, lines), self.scores(theirs, lines)
        # In the order of the rows, so that sums have the same last bits.
        shared = [key for key in a if key in b]
        return contrast(_SCORE, _by_seed(a, shared), _by_seed(b, shared))


def _case(row: Row) -> Case:
    line = Line(row[design.TEST_COLUMN], row.get(design.REPORTED_COLUMN))
    return line, row[design.SPEED_COLUMN], row[design.TARGET_COLUMN]


def overall(scores: Scores) -> float:
    """The mean over tests of the means over their speeds and seeds: every test weighs the same."""
    by_line: dict[Line, list[float]] = {}
    for (_, (line, _, _)), value in scores.items():
        by_line.setdefault(line, []).append(value)
    return float(np.mean([np.mean(own) for own in by_line.values()]))


def _by_seed(scores: Scores, keys: Iterable[tuple[int, Case]]) -> Units:
    seeds: dict[int, dict[tuple[int, Case], float]] = {}
    for key in keys:
        seeds.setdefault(key[0], {})[key] = scores[key]
    return {seed: Reading(overall(own)) for seed, own in seeds.items()}


def ncap_tables(rows: Sequence[Row]) -> list[Table]:
    """How the tests ended, then how the scores in all differ."""
    results = NcapRows(rows)
    return [
        _endings(results, {line.label: [line] for line in results.lines} | results.parts),
        *_differences(results),
    ]


def ncap_headline(rows: Sequence[Row]) -> Table:
    """How the tests ended in all."""
    results = NcapRows(rows)
    return _endings(results, results.parts)


def _endings(results: NcapRows, tests: Mapping[str, Sequence[Line]]) -> Table:
    def entry(policy: str, budget: float, held: Sequence[Line]) -> str:
        endings = results.endings((policy, budget), held)
        if not endings:
            return "-"
        counts = "/".join(str(endings[each]) for each in CollisionOutcome)
        return f"{counts} {overall(results.scores((policy, budget), held)):.2f}"

    lines = {
        f"budget {percent(budget)}": [
            (label, *(entry(policy, budget, held) for policy in results.policies))
            for label, held in tests.items()
        ]
        for budget in results.budgets or [1.0]
    }
    return Table(
        "Euro NCAP tests: avoided/mitigated/hit, and score",
        ("test", *map(results.marked, results.policies)),
        under_headings(lines),
        tag_notes(results.tags.values()),
    )


def _differences(results: NcapRows) -> list[Table]:
    """Return tables of how much each policy scores above CARE, and above the best control, in all;
    none without either.
    """

    def differences(held: Sequence[Line], against: Mapping[float, str | None]) -> list[TableRow]:
        """A line for every policy but those that all are held against, the full scan last."""
        return [
            (
                results.marked(policy),
                *(
                    interval(results.difference((policy, budget), (other, budget), held))
                    if other and other != policy
                    else ""
                    for budget, other in against.items()
                ),
            )
            for policy in sorted(results.policies, key=lambda name: name == FULL)
            if {*against.values()} != {policy}
        ]

    blocks: dict[str, list[TableRow]] = {}
    for label, held in results.parts.items():
        best = {each: results.best_control(each, held) for each in results.budgets}
        if REFERENCE in results.tags:
            reference = dict.fromkeys(results.budgets, REFERENCE)
            blocks[f"{label}: minus {REFERENCE}"] = differences(held, reference)
        if any(best.values()):
            named = (BEST_CONTROL, *(name or "" for name in best.values()))
            blocks[f"{label}: minus the {BEST_CONTROL}"] = [named, *differences(held, best)]
    title = "Euro NCAP tests: score in all, differences"
    columns = ("policy", *map(percent, results.budgets))
    notes = tag_notes(results.tags.values())
    return [Table(title, columns, under_headings(blocks), notes)] if blocks else []
