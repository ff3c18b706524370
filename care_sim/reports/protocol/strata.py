"""Recall by stratum: by range, azimuth, class, and the way in which objects enter."""

from collections.abc import Iterator, Sequence

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import ENTRY, RING_WIDTH_M
from care_sim.reports.engine.tables import budget_table
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.comparisons import reference_pairs
from care_sim.reports.protocol.formatting import share_with_ends, written
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import FULL

_ENTRIES = (
    f"Entry: where the film first shows the object; emergence nearer than "
    f"{RANGE_M - RING_WIDTH_M:.0f} m, ring up to {RANGE_M:.0f} m, beyond farther off. At start: "
    "present at scene start, no event."
)


def entry_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting recall by entry, plain and as a share of the full scan's, and CARE less
    history and less all-camera; none of rows of before there were entries, and without an event.
    """
    lines = _lines(plays, FIRST_SIGHTING, [ENTRY], of_full=bool(plays.full))
    shares = ", in brackets of the full scan's" if plays.full else ""
    notes = (f"Levels in %{shares}; differences in points. {_ENTRIES}",)
    return budget_table(plays, "first-sighting recall by entry", "policy", lines, notes)


def strata_tables(plays: SettingPlays) -> list[Table]:
    """The levels of every policy and of the full scan by stratum, and CARE less history and less
    all-camera. First sightings by entry have a table of their own.
    """
    kinds = {
        FIRST_SIGHTING: [kind for kind in plays.strata if kind != ENTRY],
        OVERALL: [*plays.strata],
    }
    return [
        table
        for ratio, own in kinds.items()
        for table in budget_table(
            plays,
            f"{ratio.name} by stratum",
            "policy",
            _lines(plays, ratio, own),
            (f"Levels in %; differences in points. {_ENTRIES if ENTRY in own else ''}".rstrip(),),
            terminal=False,
        )
    ]


def _lines(
    plays: SettingPlays, ratio: Ratio, kinds: Sequence[str], of_full: bool = False
) -> Iterator[TableRow]:
    """The lines of every stratum; none without a policy at a budget."""
    counted = "events" if ratio is FIRST_SIGHTING else "object frames"
    for kind in kinds if plays.policies else ():
        for label in plays.strata.get(kind, ()):
            within = f"{kind}/{label}"
            # A stratum with nothing to find has no lines.
            if count := plays.counted(ratio, within):
                yield (f"{kind}: {label}, {count:,.0f} {counted}",)
                yield from _lines_within(plays, ratio, within, of_full)


def _lines_within(
    plays: SettingPlays, ratio: Ratio, within: str, of_full: bool
) -> Iterator[TableRow]:
    def level(policy: str, budget: float) -> str:
        own = written(ratio, plays.level(ratio, policy, budget, within).by_event)
        share = plays.share_of_full(ratio, policy, budget, within) if of_full else None
        return f"{own} ({share_with_ends(share)})" if share else own

    for policy in plays.policies:
        yield (plays.marked(policy), *(level(policy, budget) for budget in plays.budgets))
    # The full scan has one budget and is the same beside all.
    if plays.full:
        own = written(ratio, plays.level(ratio, FULL, 1.0, within).by_event)
        yield (FULL, *[own] * len(plays.budgets))
    for pair in reference_pairs(plays, ratio, within):
        yield (pair.label, *(interval(pair.measured(plays, budget)) for budget in plays.budgets))
