"""Tables of the first-sighting protocol: those of levels, and all others in their order."""

from collections.abc import Callable, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    TTFD,
    Ratio,
    among,
    ratio_level,
)
from care_sim.evaluation.strata import NEWCOMERS
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.contrasts import protocol_contrast_tables
from care_sim.reports.protocol.controls import control_tables
from care_sim.reports.protocol.differences import RATIOS
from care_sim.reports.protocol.earlier import earlier_tables
from care_sim.reports.protocol.entries import entry_tables
from care_sim.reports.protocol.formatting import (
    PAPER,
    level_of_paper,
    share,
    share_ends,
    written,
)
from care_sim.reports.protocol.notes import left_out, of_full, papers
from care_sim.reports.protocol.paper import LEVEL_SOURCES, PUBLISHED_LEVELS
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.protocol.statements import statements_tables
from care_sim.reports.protocol.strata import allocation_tables, strata_tables, thirds_tables
from care_sim.reports.table import Table
from care_sim.study.run_config import FULL, Row

_LEVEL_COLUMNS = (
    "budget",
    "policy",
    "first sightings %",
    "of full %",
    "interval",
    "emerging %",
    "entering %",
    "overall %",
    "of full %",
    "interval",
    "TTFD",
    "equal scenes: first sightings %",
    "equal scenes: overall %",
    "equal scenes: TTFD",
    "seeds: first sightings ±",
    "seeds: overall ±",
    "scenes",
)
_OF_FULL = ("of full %", "interval")
"""Columns of a setting in which the full scan was played."""
_KINDS = tuple(f"{kind} %" for kind in NEWCOMERS)
"""Columns of rows that tell how newcomers entered."""
_DETAILS = tuple(name for name in _LEVEL_COLUMNS if ": " in name or name == "scenes")
"""Columns of which the paper says nothing."""
_LEVEL_FILES_ONLY = ("interval", *_DETAILS)
_LEVEL_WHOLE = tuple(name for name in _LEVEL_COLUMNS if name != "policy")


def protocol_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables, one setting after the other."""
    # What answers the main question comes first: differences, then levels, then details.
    made: list[Callable[[SettingPlays], list[Table]]] = [
        earlier_tables,
        protocol_contrast_tables,
        control_tables,
        levels_tables,
        entry_tables,
        statements_tables,
        strata_tables,
        thirds_tables,
        allocation_tables,
    ]
    return [table for plays in plays_by_setting(rows) for make in made for table in make(plays)]


def levels_tables(plays: SettingPlays) -> list[Table]:
    """Recall and TTFD of every policy and of the full scan, one line per policy and budget."""
    # The full scan comes last, under its own budget of all cells.
    ceiling = ((FULL, 1.0),) if plays.full else ()
    budgeted = ((policy, budget) for budget in plays.budgets for policy in plays.policies)
    keys = [key for key in (*budgeted, *ceiling) if plays.rows(*key)]
    lines = [line for key in keys for line in _level_lines(plays, *key)]
    missing = (*(() if plays.full else _OF_FULL), *(() if plays.newcomers else _KINDS))
    kept = [n for n, name in enumerate(_LEVEL_COLUMNS) if name not in missing]
    return [
        Table(
            f"{plays.setting.label}: levels",
            tuple(_LEVEL_COLUMNS[n] for n in kept),
            tuple(tuple(line[n] for n in kept) for line in lines),
            (of_full(plays), *left_out(plays), *tag_notes(plays.tags.values())),
            papers(LEVEL_SOURCES) if any(line[1] == PAPER for line in lines) else (),
            _LEVEL_FILES_ONLY,
            _LEVEL_WHOLE,
        )
    ]


def _level_lines(plays: SettingPlays, policy: str, budget: float) -> list[tuple[str, ...]]:
    first, overall, ttfd = (plays.level(ratio, policy, budget) for ratio in RATIOS)
    first_share, overall_share = (
        plays.share_of_full(ratio, policy, budget) for ratio in (FIRST_SIGHTING, OVERALL)
    )
    line = (
        percent(budget),
        marked(policy, plays.tags.get(policy, ())),
        written(FIRST_SIGHTING, first.by_event),
        share(first_share),
        share_ends(first_share),
        *(_of_kind(plays, kind, policy, budget) for kind in NEWCOMERS),
        written(OVERALL, overall.by_event),
        share(overall_share),
        share_ends(overall_share),
        written(TTFD, ttfd.by_event),
        written(FIRST_SIGHTING, first.by_scene),
        written(OVERALL, overall.by_scene),
        written(TTFD, ttfd.by_scene),
        _deviation(plays, FIRST_SIGHTING, policy, budget),
        _deviation(plays, OVERALL, policy, budget),
        str(len(plays.tallies(policy, budget))),
    )
    said = PUBLISHED_LEVELS.get((policy, budget)) if plays.setting.as_in_paper else None
    if said is None:
        return [line]
    return [line, ("", PAPER, *level_of_paper(said), *("" for _ in _DETAILS))]


def _of_kind(plays: SettingPlays, kind: str, policy: str, budget: float) -> str:
    if not plays.newcomers:
        return ""
    return written(FIRST_SIGHTING, plays.level(FIRST_SIGHTING, policy, budget, kind).by_event)


def _deviation(plays: SettingPlays, ratio: Ratio, policy: str, budget: float) -> str:
    """The most by which one floor seed differs from the mean, of the scenes that all seeds have."""
    mean = plays.tallies(policy, budget)
    # On the scenes that every seed has, else a missing scene would pass for the spread of seeds.
    seeds = [ratio_level(ratio, among(seed, mean)).by_event for seed in plays.seeds(policy, budget)]
    middle = plays.level(ratio, policy, budget).by_event
    off = [abs(value - middle) for value in seeds if value is not None and middle is not None]
    return written(ratio, max(off)) if len(off) > 1 else ""
