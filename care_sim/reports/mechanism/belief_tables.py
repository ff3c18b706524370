"""Tables of what happens on the shared belief, beside the paper's figures."""

from care_sim.reports.formatting import spread_of_counts
from care_sim.reports.mechanism import paper
from care_sim.reports.mechanism.formatting import (
    figure_of_paper,
    heading_of,
    marks_of,
    name_of,
    quotes_of_paper,
)
from care_sim.reports.mechanism.rows import MechanismRows, NewEntries
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.table import Table, TableRow


def belief_table(study: MechanismRows) -> Table:
    """What the driver's belief makes of the camera's boxes, beside the paper's figures."""
    use = study.reserve_use()
    lines = [
        ("keyframes at which U alone takes all that exploitation leaves",
         _share(use.filled, use.keyframes), paper.FILLED),
        ("keyframes at which U takes the reserve's own rho B at least",
         _share(use.filled_rho, use.keyframes), ""),
        ("cells of explained wedges outside U, per keyframe",
         _mean(use.explained_cells, use.keyframes), paper.REMOVED_CELLS),
        ("cells of them that exploitation had not taken, per keyframe",
         _mean(use.untaken_cells, use.keyframes), ""),
        *_entry_lines(study.entries(), study.driver),
    ]  # fmt: skip
    return Table(
        heading_of(study, f"on the belief of {study.driver}"),
        ("quantity", "here", PAPER),
        tuple((name, here, figure_of_paper(study, there)) for name, here, there in lines),
        quotes=quotes_of_paper(study, paper.MECHANICAL, paper.CLASS_GATE),
    )


def _entry_lines(entries: NewEntries, driver: str) -> list[TableRow]:
    pictured = int(entries.pictured.sum())
    falsely = int(entries.falsely_explained.sum())
    lost = int((entries.falsely_explained & entries.missed_by_full).sum())
    won = int((entries.falsely_explained & entries.missed & ~entries.missed_by_full).sum())
    count = len(entries.pictured)
    return [
        ("new entries with a track already, detected beyond 50 m",
         _share(int(entries.tracked.sum()), count), ""),
        ("new entries with an image box", _share(pictured, count), ""),
        ("entries with an image box that are explained falsely",
         _share(falsely, pictured), paper.FALSELY_EXPLAINED),
        ("falsely explained entries that a full scan misses too",
         _share(lost, falsely), paper.MISSED_ANYWAY),
        (f"falsely explained entries that {driver} misses and a full scan finds",
         str(won), paper.RECOVERED),
    ]  # fmt: skip


def allocation_table(study: MechanismRows) -> Table:
    """How the policies differ from the driver on its belief, and what they give to new objects."""
    lines = [_allocation_line(study, policy) for policy in study.policies]
    # On the vehicle no camera ran, so that the paper's cells are those of every policy.
    if study.as_in_paper:
        lines.append((f"{PAPER}, no camera", "", "", "", *paper.CELLS_AT_APPEARANCE))
    return Table(
        heading_of(study, f"allocations on the belief of {study.driver}"),
        (
            "policy",
            "keyframes that differ",
            PAPER,
            "cells that differ, where any",
            "cells at first appearance",
            "inside coverage",
        ),
        tuple(lines),
        (
            "Cells at first appearance: of those in the new object's dilated hull, median "
            "[quartiles] (number of objects); inside coverage where hulls of tracks hold half of "
            "it or more.",
            *marks_of(study),
        ),
        quotes_of_paper(study, paper.MECHANICAL, paper.VEHICLE_CELLS),
    )


def _allocation_line(study: MechanismRows, policy: str) -> TableRow:
    cells, covered = study.received(policy)
    own = [spread_of_counts(cells[~covered]), spread_of_counts(cells[covered])]
    if policy == study.driver:
        return (name_of(study, policy), "", "", "", *own)
    moved = study.difference(policy)
    return (
        name_of(study, policy),
        _share(moved.differing, moved.keyframes),
        figure_of_paper(study, paper.CHANGED.get(policy, "")),
        f"{moved.cells_where_differing:.0f}",
        *own,
    )


def _share(part: int, whole: int) -> str:
    """A part in per cent, and of how many."""
    return f"{100 * part / whole:.1f}% of {whole:,}" if whole else "none"


def _mean(total: int, count: int) -> str:
    return f"{total / count:,.0f}" if count else "none"
