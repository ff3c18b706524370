"""Recall by stratum: by range, azimuth, class, and the way in which objects enter."""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import ENTRY, RING_WIDTH_M
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.differences import reference_pairs
from care_sim.reports.protocol.formatting import share_with_ends, written
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import FULL

_RING_M = RANGE_M - RING_WIDTH_M
ENTRY_NOTE = (
    f"Entry: where the film first shows the object; emergence nearer than {_RING_M:.0f} m, ring up "
    f"to {RANGE_M:.0f} m, beyond farther off. At start: present at scene start, no event."
)


def entry_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting recall by entry, plain and as a share of the full scan's, and CARE less
    history and less all-camera; none of rows of before there were entries, and without an event.
    """
    title = "first-sighting recall by entry"
    table = _table(plays, title, FIRST_SIGHTING, [ENTRY], of_full=bool(plays.full))
    return [table] if plays.policies and table.rows else []


def strata_tables(plays: SettingPlays) -> list[Table]:
    """The levels of every policy and of the full scan by stratum, and CARE less history and less
    all-camera. First sightings by entry have a table of their own.
    """
    if not plays.policies:
        return []
    kinds = {
        FIRST_SIGHTING: [kind for kind in plays.strata if kind != ENTRY],
        OVERALL: [*plays.strata],
    }
    return [
        _table(plays, f"{ratio.name} by stratum", ratio, own, terminal=False)
        for ratio, own in kinds.items()
    ]


def _table(
    plays: SettingPlays,
    title: str,
    ratio: Ratio,
    kinds: Sequence[str],
    of_full: bool = False,
    terminal: bool = True,
) -> Table:
    counts = {
        (kind, label): plays.counted(ratio, f"{kind}/{label}")
        for kind in kinds
        for label in plays.strata.get(kind, ())
    }
    counted = "events" if ratio is FIRST_SIGHTING else "object frames"
    lines: list[TableRow] = []
    # A stratum with nothing to find has no lines.
    for (kind, label), count in ((stratum, count) for stratum, count in counts.items() if count):
        lines.append((f"{kind}: {label}, {count:,.0f} {counted}",))
        lines += _lines(plays, ratio, f"{kind}/{label}", of_full)
    shares = ", in brackets of the full scan's" if of_full else ""
    entries = [ENTRY_NOTE] if any(kind == ENTRY for kind, _ in counts) else []
    return Table(
        f"{plays.setting.label}: {title}",
        ("policy", *map(percent, plays.budgets)),
        tuple(lines),
        (" ".join([f"Levels in %{shares}; differences in points.", *entries]), *plays.notes),
        terminal=terminal,
    )


def _lines(plays: SettingPlays, ratio: Ratio, within: str, of_full: bool) -> Iterator[TableRow]:
    def level(policy: str, budget: float) -> str:
        return written(ratio, plays.level(ratio, policy, budget, within).by_event)

    for policy in plays.policies:
        levels = [level(policy, budget) for budget in plays.budgets]
        if of_full:
            shares = (plays.share_of_full(ratio, policy, b, within) for b in plays.budgets)
            levels = [
                f"{own} ({share_with_ends(share)})" if share else own
                for own, share in zip(levels, shares, strict=True)
            ]
        yield (plays.marked(policy), *levels)
    # The full scan has one budget and is the same beside all.
    if plays.full:
        yield (FULL, *[level(FULL, 1.0)] * len(plays.budgets))
    for pair in reference_pairs(plays, ratio, within):
        yield (pair.label, *(interval(pair.measured(plays, budget)) for budget in plays.budgets))
