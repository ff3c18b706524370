"""How many first sightings are found by the way in which objects enter, and which share that is of
what the full scan finds.
"""

from collections.abc import Iterator

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import AT_START, BEYOND, EMERGENCE, ENTRY, RING, RING_M
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.formatting import share_with_ends, written
from care_sim.reports.protocol.notes import left_out, of_full
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table
from care_sim.study.run_config import FULL

_TOLD = {
    EMERGENCE: f"first shown nearer than {RING_M:.0f} m: out from behind a body",
    RING: f"first shown from {RING_M:.0f} to {RANGE_M:.0f} m: over the ring",
    BEYOND: f"shown beyond {RANGE_M:.0f} m before",
}
ENTRY_NOTE = (
    "Entry: by where a return or a camera pixel first shows the object. "
    + "; ".join(f"{entry}: {told}" for entry, told in _TOLD.items())
    + f"; {AT_START}: present at scene start, no event."
)


def entry_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting recall by entry, plain and as a share of the full scan's; none of rows of
    before there were entries.
    """
    if not plays.policies or ENTRY not in plays.strata():
        return []
    return [
        Table(
            f"{plays.setting.label}: first-sighting recall by entry",
            ("policy", *map(percent, plays.budgets)),
            tuple(line for entry in _TOLD for line in _lines(plays, entry)),
            (
                f"Levels in %{'; in brackets: of full' if plays.full else ''}. {of_full(plays)}",
                ENTRY_NOTE,
                *left_out(plays),
                *tag_notes(plays.tags.values()),
            ),
        )
    ]


def _lines(plays: SettingPlays, entry: str) -> Iterator[tuple[str, ...]]:
    within = f"{ENTRY}/{entry}"
    events = sum(row[f"{within}/events"] for row in plays.scenes.values())
    yield (f"{entry}, {counted(int(events), 'event')}",)
    for policy, tags in plays.tags.items():
        levels = (_level(plays, policy, budget, within) for budget in plays.budgets)
        yield (marked(policy, tags), *levels)
    # The full scan has one budget and is the same beside all.
    if plays.full:
        ceiling = written(FIRST_SIGHTING, _plain(plays, FULL, 1.0, within))
        yield (FULL, *(ceiling for _ in plays.budgets))


def _level(plays: SettingPlays, policy: str, budget: float, within: str) -> str:
    plain = written(FIRST_SIGHTING, _plain(plays, policy, budget, within))
    found = plays.share_of_full(FIRST_SIGHTING, policy, budget, within)
    return f"{plain} ({share_with_ends(found)})" if found else plain


def _plain(plays: SettingPlays, policy: str, budget: float, within: str) -> float | None:
    return plays.level(FIRST_SIGHTING, policy, budget, within).by_event
