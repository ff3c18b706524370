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
from care_sim.reports.engine.tables import PAPER, control_tables
from care_sim.reports.protocol.contrasts import protocol_contrast_tables
from care_sim.reports.protocol.controls import over_controls
from care_sim.reports.protocol.details import allocation_tables, earlier_tables, thirds_tables
from care_sim.reports.protocol.formatting import rounded, share, share_ends, written
from care_sim.reports.protocol.notes import left_out, of_full, papers
from care_sim.reports.protocol.paper import LEVEL_SOURCES, PUBLISHED_LEVELS, PublishedLevel
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.protocol.statements import statements_tables
from care_sim.reports.protocol.strata import entry_tables, strata_tables
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import FULL, Row

_RATIOS = {"first sightings %": FIRST_SIGHTING, "overall %": OVERALL, "TTFD": TTFD}


def protocol_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables, one setting after the other."""
    # What answers the main question comes first: differences, then levels, then details.
    made: list[Callable[[SettingPlays], list[Table]]] = [
        earlier_tables,
        protocol_contrast_tables,
        lambda plays: control_tables(plays, over_controls(plays)),
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
    keys = [(policy, budget) for budget in plays.budgets for policy in plays.policies]
    lines: list[TableRow] = []
    columns: TableRow = ()
    for policy, budget in (*keys, (FULL, 1.0)):
        if plays.rows(policy, budget):
            said = PUBLISHED_LEVELS.get((policy, budget)) if plays.setting.as_in_paper else None
            columns, line, paper = zip(*_columns(plays, policy, budget, said), strict=True)
            lines += [line, ("", PAPER, *paper[2:])] if said else [line]
    details = tuple(name for name in columns if ": " in name or name in ("scenes", "interval"))
    return [
        Table(
            f"{plays.setting.label}: levels",
            columns,
            tuple(lines),
            (*of_full(plays), *left_out(plays)),
            papers(LEVEL_SOURCES) if any(line[1] == PAPER for line in lines) else (),
            files_only=details,
            whole=tuple(name for name in columns if name != "policy"),
        )
    ]


def _columns(
    plays: SettingPlays, policy: str, budget: float, said: PublishedLevel | None
) -> list[tuple[str, str, str]]:
    """The columns of a line: the name, what was measured, and what the paper says."""
    paper = said or PublishedLevel()
    levels = {name: plays.level(ratio, policy, budget) for name, ratio in _RATIOS.items()}
    kinds = {kind: plays.level(FIRST_SIGHTING, policy, budget, kind) for kind in plays.newcomers}

    def level(name: str, of_paper: float | None) -> tuple[str, str, str]:
        ratio = _RATIOS[name]
        return name, written(ratio, levels[name].by_event), written(ratio, of_paper)

    def of_full(ratio: Ratio, of_paper: float | None) -> list[tuple[str, str, str]]:
        # The paper gives its shares without an interval.
        found = plays.share_of_full(ratio, policy, budget)
        columns = [
            ("of full %", share(found), rounded(of_paper)),
            ("interval", share_ends(found), ""),
        ]
        return columns if plays.full else []

    return [
        ("budget", percent(budget), ""),
        ("policy", plays.marked(policy), ""),
        level("first sightings %", paper.first),
        *of_full(FIRST_SIGHTING, paper.first_of_full),
        *((f"{kind} %", written(FIRST_SIGHTING, own.by_event), "") for kind, own in kinds.items()),
        level("overall %", paper.overall),
        *of_full(OVERALL, paper.overall_of_full),
        level("TTFD", paper.ttfd),
        *(
            (f"equal scenes: {name}", written(_RATIOS[name], own.by_scene), "")
            for name, own in levels.items()
        ),
        ("seeds: first sightings ±", _deviation(plays, FIRST_SIGHTING, policy, budget), ""),
        ("seeds: overall ±", _deviation(plays, OVERALL, policy, budget), ""),
        ("scenes", str(len(plays.tallies(policy, budget))), ""),
    ]


def _deviation(plays: SettingPlays, ratio: Ratio, policy: str, budget: float) -> str:
    """The most by which one floor seed differs from the mean, of the scenes that all seeds have."""
    mean = plays.tallies(policy, budget)
    # On the scenes that every seed has, else a missing scene would pass for the spread of seeds.
    seeds = [ratio_level(ratio, among(seed, mean)).by_event for seed in plays.seeds(policy, budget)]
    middle = plays.level(ratio, policy, budget).by_event
    off = [abs(value - middle) for value in seeds if value is not None and middle is not None]
    return written(ratio, max(off)) if len(off) > 1 else ""
