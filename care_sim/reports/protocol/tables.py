"""Tables of the first-sighting protocol: those of levels, and all others in their order."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    TTFD,
    Ratio,
    among,
    ratio_level,
)
from care_sim.evaluation.sightings import RANGE_M
from care_sim.evaluation.strata import ENTRY, RING_WIDTH_M
from care_sim.reports.engine.tables import PAPER, budget_table, control_tables
from care_sim.reports.formatting import ends, interval
from care_sim.reports.protocol.comparisons import reference_pairs
from care_sim.reports.protocol.contrasts import over_controls, protocol_contrast_tables
from care_sim.reports.protocol.details import allocation_tables, earlier_tables, thirds_tables
from care_sim.reports.protocol.formatting import (
    MET,
    NOT_MET,
    UNDECIDED,
    judged,
    left_out,
    of_full,
    papers,
    rounded,
    share,
    share_ends,
    share_with_ends,
    verdict,
    written,
)
from care_sim.reports.protocol.paper import (
    LEVEL_SOURCES,
    PAPER_BUDGETS,
    PUBLISHED_LEVELS,
    PublishedLevel,
    claims_about,
)
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import FULL, Row

_ENTRIES = (
    f"Entry: where the film first shows the object; emergence nearer than "
    f"{RANGE_M - RING_WIDTH_M:.0f} m, ring up to {RANGE_M:.0f} m, beyond farther off. At start: "
    "present at scene start, no event."
)


def entry_tables(plays: SettingPlays) -> list[Table]:
    """Return tables of first-sighting recall by entry, plain and as a share of the full scan's, and
    CARE minus history and all-camera. None for older rows without entries, and without an event.
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


def statements_tables(plays: SettingPlays) -> list[Table]:
    """One line per statement, at the paper's budgets; none where the paper says nothing of such
    plays.
    """
    said = claims_about(plays.setting)
    # Only the budgets of which the paper speaks: a verdict needs a claim.
    budgets = [budget for budget in plays.budgets if budget in PAPER_BUDGETS]
    lines: list[TableRow] = []
    sources: list[str] = []
    verdicts: Counter[str] = Counter()
    heading = ""
    for each, claims in said.items():
        if not set(each.policies) <= set(plays.policies):
            continue
        found = {budget: each.measured(plays, budget) for budget in budgets}
        if not any(found.values()):
            continue
        # Statements come measure by measure. A heading opens each measure.
        if each.heading != heading:
            heading = each.heading
            lines.append((heading,))
        entries = [
            entry
            for budget, difference in found.items()
            for entry in (judged(difference, claims.at(budget)), ends(difference))
        ]
        lines.append((each.label, *entries))
        sources.append(claims.source)
        # A budget that was not played, or of which the paper says nothing, is no verdict.
        verdicts.update(
            verdict(difference, claim.sign)
            for budget, difference in found.items()
            if difference and (claim := claims.at(budget))
        )
    if not lines:
        return []
    listed = ", ".join(f"{verdicts[each]} {each}" for each in (MET, NOT_MET, UNDECIDED))
    return [
        Table(
            f"{plays.setting.label}: the paper's statements",
            ("statement", *(name for each in budgets for name in (percent(each), "interval"))),
            tuple(lines),
            (f"{verdicts.total()} verdicts, the paper's difference in brackets: {listed}.",),
            papers(sources),
            files_only=("interval",),
        )
    ]


_RATIOS = {"first sightings %": FIRST_SIGHTING, "overall %": OVERALL, "TTFD": TTFD}


def protocol_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables, one setting after the other."""
    # The answer to the main question comes first: differences, then levels, then details.
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
