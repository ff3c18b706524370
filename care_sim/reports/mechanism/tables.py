"""The tables of the mechanism: of the shared belief beside the paper, then of separate plays."""

from collections.abc import Sequence
from itertools import combinations, permutations

from care_sim.base.errors import counted, percent
from care_sim.evaluation.miss_reasons import MISS_REASONS
from care_sim.evaluation.ray_shares import RAY_SHARES
from care_sim.reports.formatting import marked, spread_of_counts
from care_sim.reports.mechanism import paper
from care_sim.reports.mechanism.rows import MechanismRows
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import Row


def mechanism_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables; none of full scans alone, since everything is compared with the driver."""
    study = MechanismRows(rows)
    if study.driver not in study.policies:
        return []
    return [
        _belief(study),
        _allocations(study),
        _order(study),
        _credit(study),
        _misses(study),
    ]


def mechanism_closing(rows: Sequence[Row]) -> list[str]:
    """How much was played."""
    study = MechanismRows(rows)
    return [
        f"Scenes: {len(study.scenes):,}, with {counted(study.events, 'first sighting')}; plays: "
        f"{len(rows):,}."
    ]


def _table(
    study: MechanismRows,
    what: str,
    columns: TableRow,
    lines: Sequence[TableRow],
    note: str = "",
    *quotes: str,
) -> Table:
    """A table under setting and budget. The paper is quoted where its figures are of the same."""
    title = f"{study.setting.label}, {percent(study.budget)}: {what}"
    said = papers(quotes) if study.as_in_paper else ()
    return Table(title, columns, tuple(lines), (note,), said)


def _name(study: MechanismRows, policy: str) -> str:
    return marked(policy, study.tags[policy])


def _belief(study: MechanismRows) -> Table:
    """What the driver's belief makes of the camera's boxes."""
    use, entries = study.reserve_use(), study.entries()
    falsely, pictured = entries.falsely_explained, int(entries.pictured.sum())
    lost = int((falsely & entries.missed_by_full).sum())
    won = int((falsely & entries.missed & ~entries.missed_by_full).sum())
    lines = [
        ("keyframes at which U alone takes all that exploitation leaves",
         _share(use.filled, use.keyframes), paper.FILLED),
        ("keyframes at which U takes the reserve's own rho B at least",
         _share(use.filled_rho, use.keyframes), ""),
        ("cells of explained wedges outside U, per keyframe",
         _mean(use.explained_cells, use.keyframes), paper.REMOVED_CELLS),
        ("cells of them that exploitation had not taken, per keyframe",
         _mean(use.untaken_cells, use.keyframes), ""),
        ("new entries with a track already, detected beyond 50 m",
         _share(int(entries.tracked.sum()), len(entries.pictured)), ""),
        ("new entries with an image box", _share(pictured, len(entries.pictured)), ""),
        ("entries with an image box that are explained falsely",
         _share(int(falsely.sum()), pictured), paper.FALSELY_EXPLAINED),
        ("falsely explained entries that a full scan misses too",
         _share(lost, int(falsely.sum())), paper.MISSED_ANYWAY),
        (f"falsely explained entries that {study.driver} misses and a full scan finds",
         str(won), paper.RECOVERED),
    ]  # fmt: skip
    beside = [(name, here, _of_paper(study, there)) for name, here, there in lines]
    quotes = (paper.MECHANICAL, paper.CLASS_GATE)
    columns = ("quantity", "here", PAPER)
    return _table(study, f"on the belief of {study.driver}", columns, beside, "", *quotes)


def _allocations(study: MechanismRows) -> Table:
    """How the policies differ from the driver on its belief, and what they give to new objects."""
    lines: list[TableRow] = []
    for policy in study.policies:
        cells, covered = study.received(policy)
        moved = ("", "", "")
        if policy != study.driver:
            found = study.difference(policy)
            share = _share(found.differing, found.keyframes)
            said = _of_paper(study, paper.CHANGED.get(policy, ""))
            moved = (share, said, f"{found.cells_where_differing:.0f}")
        own = (spread_of_counts(cells[~covered]), spread_of_counts(cells[covered]))
        lines.append((_name(study, policy), *moved, *own))
    # On the vehicle no camera ran, so that the paper's cells are those of every policy.
    if study.as_in_paper:
        lines.append((f"{PAPER}, no camera", "", "", "", *paper.CELLS_AT_APPEARANCE))
    return _table(
        study,
        f"allocations on the belief of {study.driver}",
        ("policy", "keyframes that differ", PAPER, "cells that differ, where any",
         "cells at first appearance", "inside coverage"),
        lines,
        "Cells in the new object's dilated hull: median [quartiles] (objects).",
        paper.MECHANICAL,
        paper.VEHICLE_CELLS,
    )  # fmt: skip


def _order(study: MechanismRows) -> Table:
    """Who found the events first, each policy on its own play."""
    lines: list[TableRow] = []
    for first, second in combinations(study.policies, 2):
        order = study.order(first, second)
        said = _of_paper(study, paper.ORDER.get((first, second), ""))
        counts = map(str, (order.earlier, order.later, order.tied))
        lines.append((_name(study, first), _name(study, second), *counts, said))
    return _table(
        study,
        "events found earlier, later or at the same keyframe",
        ("first", "second", "earlier", "later", "tied", f"{PAPER} of 104"),
        lines,
        "Tied: also events that neither detects within 6 keyframes.",
        paper.VEHICLE_ORDER,
    )


def _credit(study: MechanismRows) -> Table:
    """Who fired the rays of the first sightings that one policy caught and another missed."""
    lines: list[TableRow] = []
    for caught, missed in permutations(study.policies, 2):
        credit, tracked = study.credit(caught, missed)
        # A pair without such a sighting has nothing to share out.
        if len(credit):
            shares = (f"{100 * share:.0f}%" for share in credit.mean(axis=0))
            names = _name(study, caught), _name(study, missed)
            lines.append((*names, str(len(credit)), *shares, str(tracked.sum())))
    shares = (share.replace("_", " ") for share in RAY_SHARES)
    return _table(
        study,
        "whose rays caught what the other missed",
        ("caught by", "missed by", "first sightings", *shares, "tracked already"),
        lines,
        "Rays that hit the object in its first keyframe. Tracked already: detected beyond 50 m.",
    )


def _misses(study: MechanismRows) -> Table:
    """Why policies missed first sightings that the full scan finds."""
    lines: list[TableRow] = []
    for policy in study.policies:
        misses = study.misses(policy)
        counts = map(str, (study.found_by_full(policy), sum(misses.values()), *misses.values()))
        lines.append((_name(study, policy), *counts))
    return _table(
        study,
        "why first sightings were missed that the full scan finds",
        ("policy", "found by full", "missed", *MISS_REASONS),
        lines,
        "Without a camera, the first three reasons say what a camera would have shown.",
    )


def _of_paper(study: MechanismRows, figure: str) -> str:
    """A figure of the paper, where it is of the same."""
    return figure if study.as_in_paper else ""


def _share(part: int, whole: int) -> str:
    """A part in per cent, and of how many."""
    return f"{100 * part / whole:.1f}% of {whole:,}" if whole else "none"


def _mean(total: int, count: int) -> str:
    return f"{total / count:,.0f}" if count else "none"
