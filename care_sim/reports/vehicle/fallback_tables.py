"""What policies fire while the camera is away, and what that costs."""

from collections.abc import Iterator, Sequence

import numpy as np

from care_sim.reports.contrasts import AVOIDED, DETECTION, contrast
from care_sim.reports.formatting import interval, spread_of_counts
from care_sim.reports.mechanism.paper import CELLS_AT_APPEARANCE, VEHICLE_CELLS
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.protocol.notes import papers
from care_sim.reports.table import Table, TableRow
from care_sim.reports.vehicle import paper
from care_sim.reports.vehicle.rows import VehicleRows, joined, outcome, total
from care_sim.study.designs.variants import Group, Variant
from care_sim.study.designs.vehicle import BLACKOUTS, FALLBACK_POLICIES
from care_sim.study.run_config import REFERENCE, Row
from care_sim.study.vehicle.play import ASKED

_ENTRIES = (
    "New entries: bodies that a faultless camera would show for the first time then. Cells: of "
    "those in the dilated hull of the new body, median [quartiles] (number of bodies); inside "
    "coverage where hulls of tracks hold half of it or more."
)


def fallback_table(study: VehicleRows) -> Table:
    """Whether the policies are one while the camera is away, and for how long after."""
    lines = []
    for group, levels in BLACKOUTS.items():
        for level in levels:
            rows = study.of(group, level, REFERENCE)
            if total(rows, "dark_keyframes"):
                lines.append((f"{group.name}: {level.label}", *_alike(rows)))
    lines.append((PAPER, "", paper.ENTRIES_ALIKE, *CELLS_AT_APPEARANCE, ""))
    return Table(
        f"Allocations of {', '.join(ASKED)} on the belief of {REFERENCE} without a camera",
        (
            "camera",
            "keyframes alike",
            "new entries alike",
            "cells at first appearance",
            "inside coverage",
            "apart again after, s",
        ),
        tuple(lines),
        (_ENTRIES,),
        papers((VEHICLE_CELLS,)),
    )


def _alike(rows: Sequence[Row]) -> TableRow:
    cells = joined(rows, "dark_entry_cells")
    covered = joined(rows, "dark_entry_covered").astype(bool)
    entries = joined(rows, "dark_entries_alike")
    apart = np.array([row["apart_after_s"] for row in rows if row["apart_after_s"] is not None])
    return (
        f"{total(rows, 'dark_alike'):,} of {total(rows, 'dark_keyframes'):,}",
        f"{int(entries.sum())} of {len(entries)}",
        spread_of_counts(cells[~covered]),
        spread_of_counts(cells[covered]),
        f"{np.median(apart):.1f} ({len(apart)} of {len(rows)})" if len(apart) else "",
    )


def cost_tables(study: VehicleRows) -> list[Table]:
    """In every place, first detections and collisions with the camera on, away for a time, and away
    throughout.
    """
    tables = []
    for group, levels in BLACKOUTS.items():
        on, times, _ = levels
        lost = f"{on.label} minus {times.label}"
        columns = ("policy", *(level.label for level in levels), f"{lost}, m", f"{lost}, points")
        title = f"{group.name}: what a camera that fails costs, first detection, m, and collisions"
        tables.append(Table(title, columns, tuple(_cost_lines(study, group, levels))))
    return tables


def _cost_lines(study: VehicleRows, group: Group, levels: Sequence[Variant]) -> Iterator[TableRow]:
    for policy in study.further(FALLBACK_POLICIES):
        cells = [study.of(group, level, policy) for level in levels]
        if any(cells):
            yield (
                study.marked(policy),
                *map(outcome, cells),
                interval(contrast(DETECTION, cells[0], cells[1])),
                interval(contrast(AVOIDED, cells[0], cells[1])),
            )
