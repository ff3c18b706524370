"""Where the all-camera reserve collapses as the number of tracked vehicles in the dense street
grows.
"""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.reports.cells import StudyCells
from care_sim.reports.contrasts import Contrast
from care_sim.reports.formatting import interval, mean, median
from care_sim.reports.table import Table
from care_sim.study.designs.crowding import CROWDING_POLICIES, VEHICLES_COLUMN
from care_sim.study.rows.reading import Key, key_of
from care_sim.study.run_config import Row

_TITLE = "dense, by standing vehicles: "
COLLAPSE_M = 3.0
"""All-camera counts as collapsed where CARE detects this much earlier and the interval excludes
zero.
"""


class Crowd:
    """The rows of a crowding study by standing vehicles and budget."""

    def __init__(self, rows: Sequence[Row]):
        self.study = StudyCells(rows)
        self.counts = sorted({row[VEHICLES_COLUMN] for row in rows})
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != "full"})
        self.others = [
            "all-camera",
            *(policy for policy in self.study.policies if policy not in CROWDING_POLICIES),
        ]

    def key(self, vehicles: int, policy: str, budget: float) -> Key:
        """Where the rows are found."""
        return key_of(
            {"scenario": "dense", "policy": policy, "budget": budget, VEHICLES_COLUMN: vehicles}
        )

    def gap(self, vehicles: int, budget: float, other: str = "all-camera") -> Contrast | None:
        """First detection of another policy minus that of CARE, metres; negative where the other is
        later.
        """
        return self.study.difference(
            self.key(vehicles, other, budget), self.key(vehicles, "care", budget)
        )

    def median(self, vehicles: int, policy: str, budget: float) -> str:
        """A median first detection, as text."""
        cell = self.study.cell(self.key(vehicles, policy, budget))
        return median(cell.detection if cell else None)

    def collapsed(self, budget: float) -> list[int]:
        """Numbers of vehicles at which all-camera has collapsed."""
        gaps = {vehicles: self.gap(vehicles, budget) for vehicles in self.counts}
        return [
            n
            for n, gap in gaps.items()
            # The cautious mean: a collapse is claimed only if it holds wherever the censored
            # distances lie.
            if gap and gap.excludes_zero and gap.difference.cautious.mean <= -COLLAPSE_M
        ]


def crowding_tables(rows: Sequence[Row]) -> list[Table]:
    """Tables of how much less all-camera, and every further policy, has than CARE, by standing
    vehicles and budget: differences, intervals, and the medians behind them.
    """
    crowd = Crowd(rows)
    gaps = [
        _gaps_table(crowd, other, intervals)
        for other in crowd.others
        for intervals in (False, True)
    ]
    return [*gaps, _medians_table(crowd)]


def _gaps_table(crowd: Crowd, other: str, intervals: bool) -> Table:
    entry, more = (interval, ", with intervals") if intervals else (mean, "")
    lines = [
        (str(n), *(entry(crowd.gap(n, budget, other)) for budget in crowd.budgets))
        for n in crowd.counts
    ]
    title = f"{_TITLE}first detection of {crowd.study.marked(other)} minus care, m{more}"
    notes = (
        (_collapse_note(crowd),)
        # The note on collapses belongs to the one table that shows them.
        if other == "all-camera" and not intervals
        else crowd.study.notes([other])
    )
    return Table(
        title,
        ("vehicles", *map(percent, crowd.budgets)),
        tuple(lines),
        notes,
        terminal=not intervals,
    )


def _medians_table(crowd: Crowd) -> Table:
    policies = ["care", *crowd.others]
    lines = [
        (
            str(n),
            *(_medians(crowd, n, policies, budget) for budget in crowd.budgets),
            crowd.median(n, "full", 1.0),
        )
        for n in crowd.counts
    ]
    title = f"{_TITLE}median first detection, {'/'.join(map(crowd.study.marked, policies))}, m"
    columns = ("vehicles", *map(percent, crowd.budgets), "full")
    return Table(
        title,
        columns,
        tuple(lines),
        ("n.d.: not detected.", *crowd.study.notes(policies)),
        terminal=False,
    )


def _medians(crowd: Crowd, vehicles: int, policies: Sequence[str], budget: float) -> str:
    medians = (crowd.median(vehicles, policy, budget) for policy in policies)
    # Several medians share an entry, which has no room for words.
    return "/".join(medians).replace("not detected", "n.d.")


def _collapse_note(crowd: Crowd) -> str:
    found = [(percent(budget), crowd.collapsed(budget)) for budget in crowd.budgets]
    listed = "; ".join(
        f"{budget}: {', '.join(map(str, counts)) or 'none'}" for budget, counts in found
    )
    return (
        f"All-camera has collapsed (at least {COLLAPSE_M:.0f} m later than care on average, "
        f"interval without zero), by budget, at these numbers of vehicles: {listed}."
    )
