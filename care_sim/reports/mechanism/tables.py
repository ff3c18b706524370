"""Tables of the mechanism: what happens on the shared belief, and the account of the rays."""

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from care_sim.base.errors import percent
from care_sim.core.arrays import Integers
from care_sim.evaluation.miss_reasons import MISS_REASONS
from care_sim.evaluation.ray_shares import RAY_SHARES
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.mechanism import paper
from care_sim.reports.mechanism.rows import MechanismRows, NewEntries
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import Row

_CREDIT_COLUMNS = tuple(share.replace("_", " ") for share in RAY_SHARES)


def mechanism_tables(rows: Sequence[Row]) -> list[Table]:
    """All tables: first those of the shared belief, then those of separate plays."""
    study = MechanismRows(rows)
    # Everything is compared with the driver or belongs to a policy: full scans alone show nothing.
    if study.driver not in study.policies:
        return []
    return [
        belief_table(study),
        allocation_table(study),
        order_table(study),
        credit_table(study),
        misses_table(study),
    ]


def mechanism_closing(rows: Sequence[Row]) -> list[str]:
    """How much was played."""
    study = MechanismRows(rows)
    return [
        f"Scenes: {len(study.scenes):,}, with {study.events:,} first sightings; plays: "
        f"{len(rows):,}."
    ]


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
        ("of these, cells that exploitation had not taken",
         _mean(use.untaken_cells, use.keyframes), ""),
        *_entry_lines(study.entries(), study.driver),
    ]  # fmt: skip
    return Table(
        f"{_heading(study)}: on the belief of {study.driver}",
        ("quantity", "here", PAPER),
        tuple((name, here, _said(study, there)) for name, here, there in lines),
        quotes=_quotes(study, paper.MECHANICAL, paper.CLASS_GATE),
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
        ("of these, explained falsely", _share(falsely, pictured), paper.FALSELY_EXPLAINED),
        ("of these, missed by a full scan too", _share(lost, falsely), paper.MISSED_ANYWAY),
        (f"of these, missed by {driver} and found by a full scan", str(won), paper.RECOVERED),
    ]  # fmt: skip


def allocation_table(study: MechanismRows) -> Table:
    """How the policies differ from the driver on its belief, and what they give to new objects."""
    return Table(
        f"{_heading(study)}: allocations on the belief of {study.driver}",
        (
            "policy",
            "keyframes that differ",
            PAPER,
            "cells that differ, where any",
            "cells at first appearance",
            "inside coverage",
        ),
        tuple(_allocation_line(study, policy) for policy in study.policies),
        (
            "Cells at first appearance: of those in the new object's dilated hull, median "
            "[quartiles] (number of objects); inside coverage where hulls of tracks hold half of "
            "it or more.",
            *_notes(study),
        ),
        _quotes(study, paper.MECHANICAL, paper.VEHICLE_CELLS),
    )


def _allocation_line(study: MechanismRows, policy: str) -> TableRow:
    cells, covered = study.received(policy)
    own = [_spread(cells[~covered]), _spread(cells[covered])]
    if policy == study.driver:
        return (_name(study, policy), "", "", "", *own)
    moved = study.difference(policy)
    return (
        _name(study, policy),
        _share(moved.differing, moved.keyframes),
        _said(study, paper.CHANGED.get(policy, "")),
        f"{moved.cells_where_differing:.0f}",
        *own,
    )


def order_table(study: MechanismRows) -> Table:
    """Who found the events first, each policy on its own play."""
    lines = []
    for first, second in combinations(study.policies, 2):
        order = study.order(first, second)
        said = _said(study, paper.ORDER.get((first, second), ""))
        counts = map(str, (order.earlier, order.later, order.tied))
        lines.append((_name(study, first), _name(study, second), *counts, said))
    return Table(
        f"{_heading(study)}: events found earlier, later or at the same keyframe",
        ("first", "second", "earlier", "later", "tied", f"{PAPER} of 104"),
        tuple(lines),
        (
            "Each policy on its own play; two that do not find an event within 6 keyframes are "
            "tied.",
            *_notes(study),
        ),
        _quotes(study, paper.VEHICLE_ORDER),
    )


def credit_table(study: MechanismRows) -> Table:
    """Who fired the rays of the first sightings that one policy caught and another missed."""
    lines = []
    for caught, missed in permutations(study.policies, 2):
        credit, tracked = study.credit(caught, missed)
        # A pair without such a sighting has nothing to share out.
        if len(credit):
            shares = (f"{100 * share:.0f}%" for share in credit.mean(axis=0))
            names = _name(study, caught), _name(study, missed)
            lines.append((*names, str(len(credit)), *shares, str(tracked.sum())))
    return Table(
        f"{_heading(study)}: whose rays caught what the other missed",
        ("caught by", "missed by", "first sightings", *_CREDIT_COLUMNS, "tracked already"),
        tuple(lines),
        (
            "Of the rays that hit the object at its first keyframe, in the play that caught it; "
            "every sighting weighs the same. Layer 1 of care is U. Tracked already: sightings of "
            "objects that the catching policy had detected before, beyond 50 m.",
            *_notes(study),
        ),
    )


def misses_table(study: MechanismRows) -> Table:
    """Why policies missed first sightings that the full scan finds."""
    lines = []
    for policy in study.policies:
        misses = study.misses(policy)
        counts = map(str, (study.found_by_full(policy), sum(misses.values()), *misses.values()))
        lines.append((_name(study, policy), *counts))
    return Table(
        f"{_heading(study)}: why first sightings were missed that the full scan finds",
        ("policy", "found by full", "missed", *MISS_REASONS),
        tuple(lines),
        (
            "Of a policy that never asks the camera, the first three reasons tell what the camera "
            "would have shown it.",
            *_notes(study),
        ),
    )


def _heading(study: MechanismRows) -> str:
    return f"{study.setting.label}, {percent(study.budget)}"


def _name(study: MechanismRows, policy: str) -> str:
    return marked(policy, study.tags[policy])


def _said(study: MechanismRows, figure: str) -> str:
    """A figure of the paper, where it is of the same."""
    return figure if study.as_in_paper else ""


def _quotes(study: MechanismRows, *sentences: str) -> tuple[str, ...]:
    return papers(sentences) if study.as_in_paper else ()


def _notes(study: MechanismRows) -> tuple[str, ...]:
    return tag_notes(study.tags.values())


def _share(part: int, whole: int) -> str:
    """A part in per cent, and of how many."""
    return f"{100 * part / whole:.1f}% of {whole:,}" if whole else "none"


def _mean(total: int, count: int) -> str:
    return f"{total / count:,.0f}" if count else "none"


def _spread(cells: Integers) -> str:
    """Median, quartiles and number of counts; empty without any."""
    if not len(cells):
        return ""
    low, middle, high = np.quantile(cells, (0.25, 0.5, 0.75))
    return f"{middle:.0f} [{low:.0f}, {high:.0f}] ({len(cells)})"
