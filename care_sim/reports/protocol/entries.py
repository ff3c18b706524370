"""How many first sightings are found by the way in which objects enter, and which share that is of
what the full scan finds.
"""

from collections.abc import Iterator

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import AT_START, BEYOND, EMERGENCE, ENTRY, RING, RING_WIDTH_M
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.protocol.differences import reference_pairs
from care_sim.reports.protocol.formatting import share_with_ends, written
from care_sim.reports.protocol.notes import left_out, of_full
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table
from care_sim.study.run_config import FULL

_RING_M = RANGE_M - RING_WIDTH_M
_TOLD = {
    EMERGENCE: f"nearer than {_RING_M:.0f} m, presumably out from behind a body",
    RING: f"from {_RING_M:.0f} to {RANGE_M:.0f} m, presumably over the edge of the range",
    BEYOND: f"beyond {RANGE_M:.0f} m, before it was scored",
}
ENTRY_NOTE = (
    "Entry: by where the film first shows the object (streets: a return or a camera pixel; "
    "recordings: a point in its box, or without points its first label). "
    + "; ".join(f"{entry}: {told}" for entry, told in _TOLD.items())
    + f"; {AT_START}: present at scene start, no event."
)


def entry_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting recall by entry, plain and as a share of the full scan's, and CARE less
    history and less all-camera; none of rows of before there were entries, and without an event.
    """
    counts = _event_counts(plays)
    if not plays.policies or not counts:
        return []
    differences = ("Differences in points.",) if reference_pairs(plays) else ()
    return [
        Table(
            f"{plays.setting.label}: first-sighting recall by entry",
            ("policy", *map(percent, plays.budgets)),
            tuple(line for entry in counts for line in _lines(plays, entry, counts[entry])),
            (
                f"Levels in %{'; in brackets: of full' if plays.full else ''}. {of_full(plays)}",
                *differences,
                ENTRY_NOTE,
                *left_out(plays),
                *tag_notes(plays.tags.values()),
            ),
        )
    ]


def _event_counts(plays: SettingPlays) -> dict[str, float]:
    """The events of every entry that has any."""
    if ENTRY not in plays.strata():
        return {}
    counts = {entry: plays.counted(FIRST_SIGHTING, f"{ENTRY}/{entry}") for entry in _TOLD}
    return {entry: count for entry, count in counts.items() if count}


def _lines(plays: SettingPlays, entry: str, events: float) -> Iterator[tuple[str, ...]]:
    within = f"{ENTRY}/{entry}"
    yield (f"{entry}, {counted(int(events), 'event')}",)
    for policy, tags in plays.tags.items():
        levels = (_level(plays, policy, budget, within) for budget in plays.budgets)
        yield (marked(policy, tags), *levels)
    # The full scan has one budget and is the same beside all.
    if plays.full:
        ceiling = written(FIRST_SIGHTING, _plain(plays, FULL, 1.0, within))
        yield (FULL, *(ceiling for _ in plays.budgets))
    for pair in reference_pairs(plays, FIRST_SIGHTING, within):
        yield (pair.label, *(interval(pair.measured(plays, budget)) for budget in plays.budgets))


def _level(plays: SettingPlays, policy: str, budget: float, within: str) -> str:
    plain = written(FIRST_SIGHTING, _plain(plays, policy, budget, within))
    found = plays.share_of_full(FIRST_SIGHTING, policy, budget, within)
    return f"{plain} ({share_with_ends(found)})" if found else plain


def _plain(plays: SettingPlays, policy: str, budget: float, within: str) -> float | None:
    return plays.level(FIRST_SIGHTING, policy, budget, within).by_event
