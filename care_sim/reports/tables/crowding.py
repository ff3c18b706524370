"""Where the all-camera reserve collapses as the number of tracked vehicles in the dense street
grows.
"""

from collections.abc import Iterable, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level_of
from care_sim.reports.engine.measures import DETECTION
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
        self.study = Frame(rows)
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
        return self.study.contrast(
            DETECTION, self.key(vehicles, other, budget), self.key(vehicles, "care", budget)
        )

    def median(self, vehicles: int, policy: str, budget: float) -> str:
        """A median first detection, as text."""
        cell = level_of(self.study, self.key(vehicles, policy, budget))
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
    """How much less all-camera, and every further policy, has than CARE, by standing vehicles and
    budget: differences, intervals, and the medians behind them.
    """
    crowd = Crowd(rows)
    made: list[Table] = []
    for other in crowd.others:
        title = f"first detection of {crowd.study.marked(other)} minus care, m"
        gaps = {n: [crowd.gap(n, budget, other) for budget in crowd.budgets] for n in crowd.counts}
        means = {n: map(mean, own) for n, own in gaps.items()}
        intervals = {n: map(interval, own) for n, own in gaps.items()}
        collapses = _collapses(crowd) if other == "all-camera" else ""
        made.append(_table(crowd, title, means, (collapses,)))
        made.append(_table(crowd, f"{title}, with intervals", intervals, terminal=False))
    policies = ["care", *crowd.others]
    medians = {
        n: (
            # Several medians share an entry, which has no room for words.
            *(
                "/".join(crowd.median(n, p, budget) for p in policies).replace(
                    "not detected", "n.d."
                )
                for budget in crowd.budgets
            ),
            crowd.median(n, "full", 1.0),
        )
        for n in crowd.counts
    }
    title = f"median first detection, {'/'.join(map(crowd.study.marked, policies))}, m"
    return [*made, _table(crowd, title, medians, crowd.study.notes(policies), ("full",), False)]


def _table(
    crowd: Crowd,
    title: str,
    entries: Mapping[int, Iterable[str]],
    notes: tuple[str, ...] = (),
    further: tuple[str, ...] = (),
    terminal: bool = True,
) -> Table:
    """Vehicles by budgets, and `further` columns."""
    lines = tuple((str(n), *own) for n, own in entries.items())
    columns = ("vehicles", *map(percent, crowd.budgets), *further)
    return Table(f"{_TITLE}{title}", columns, lines, notes, terminal=terminal)


def _collapses(crowd: Crowd) -> str:
    found = ((budget, crowd.collapsed(budget)) for budget in crowd.budgets)
    listed = "; ".join(f"{percent(b)}: {', '.join(map(str, n))}" for b, n in found if n)
    return f"All-camera at least {COLLAPSE_M:.0f} m later, interval without 0: {listed or 'never'}."
