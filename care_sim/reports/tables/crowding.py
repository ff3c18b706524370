"""The collapse of the all-camera reserve with the number of tracked vehicles in the dense
street.
"""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import DETECTION
from care_sim.reports.formatting import interval, mean
from care_sim.reports.table import Table
from care_sim.study.designs.paper import CROWDING_POLICIES, VEHICLES_COLUMN
from care_sim.study.designs.variants import USUAL_VARIANT, Place
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL, Row

COLLAPSE_M = 3.0
"""All-camera counts as collapsed where CARE detects this much earlier and the interval excludes
zero.
"""


class Crowd:
    """The rows of a crowding study by standing vehicles and budget."""

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        self.counts = sorted({row[VEHICLES_COLUMN] for row in rows})
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})

    def key(self, vehicles: int, policy: str, budget: float) -> Key:
        """Return the key of the rows."""
        place = Place("dense", budget, (("vehicles", vehicles),))
        return USUAL_VARIANT.key(place, policy)

    def gap(self, vehicles: int, budget: float, other: str = "all-camera") -> Contrast | None:
        """First detection of another policy minus that of CARE, metres; negative where the other is
        later.
        """
        return self.frame.contrast(
            DETECTION, self.key(vehicles, other, budget), self.key(vehicles, "care", budget)
        )

    def median(self, vehicles: int, policy: str, budget: float) -> str:
        """A median first detection, as text; a dash where nothing was played."""
        units = self.frame.units(DETECTION, self.key(vehicles, policy, budget))
        # Several medians share an entry, which has no room for words.
        return level(DETECTION, units).replace("not detected", "n.d.") or "-"

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
    joined = [policy for policy in crowd.frame.policies if policy not in CROWDING_POLICIES]
    others = ["all-camera", *joined]
    made: list[Table] = []
    for other in others:
        title = f"first detection of {crowd.frame.marked(other)} minus care, m"
        gaps = [[crowd.gap(n, budget, other) for budget in crowd.budgets] for n in crowd.counts]
        note = _collapses(crowd) if other == "all-camera" else ""
        made += [
            _table(crowd, title, [[*map(mean, own)] for own in gaps], (note,), terminal=True),
            _table(crowd, f"{title}, with intervals", [[*map(interval, own)] for own in gaps]),
        ]
    policies = ["care", *others]
    medians = [
        [
            *("/".join(crowd.median(n, p, budget) for p in policies) for budget in crowd.budgets),
            crowd.median(n, FULL, 1.0),
        ]
        for n in crowd.counts
    ]
    title = f"median first detection, {'/'.join(map(crowd.frame.marked, policies))}, m"
    return [*made, _table(crowd, title, medians, crowd.frame.notes(policies), [FULL])]


def _table(
    crowd: Crowd,
    title: str,
    entries: Sequence[Sequence[str]],
    notes: tuple[str, ...] = (),
    further: Sequence[str] = (),
    terminal: bool = False,
) -> Table:
    """Vehicles by budgets, and `further` columns."""
    return Table(
        f"dense, by standing vehicles: {title}",
        ("vehicles", *map(percent, crowd.budgets), *further),
        tuple((str(n), *own) for n, own in zip(crowd.counts, entries, strict=True)),
        notes,
        terminal=terminal,
    )


def _collapses(crowd: Crowd) -> str:
    found = ((budget, crowd.collapsed(budget)) for budget in crowd.budgets)
    listed = "; ".join(f"{percent(b)}: {', '.join(map(str, n))}" for b, n in found if n)
    return f"All-camera at least {COLLAPSE_M:.0f} m later, interval without 0: {listed or 'never'}."
