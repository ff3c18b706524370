"""The table of B90 on recorded drives, source by source."""

from collections.abc import Sequence
from dataclasses import replace

from care_sim.reports.budgets import format_smallest, least_notes, reachable, sorted_by_budget
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.table import Table
from care_sim.study.benchmark.budgets import BudgetResult
from care_sim.study.benchmark.recorded import RECORDED, RECORDED_PARTS, source_of_world

_NOTE = (
    "B90 in % of all cells, over all drives and over those of each source alone. Few drives carry "
    "no interval."
)


def sources_table(results: Sequence[BudgetResult]) -> Table:
    """Return a table with a line per result, in the order of `sorted_by_budget`, and a column per
    source of recorded drives. All results must be of the same worlds, and have recorded ones.
    """
    ordered = sorted_by_budget([_together(one) for one in results])
    rows = [
        (
            marked(one.entry.name, one.tags),
            *map(format_smallest, (one, *_by_source(one).values())),
        )
        for one in ordered
    ]
    told = (reachable(source, own, "drive") for source, own in _by_source(ordered[0]).items())
    return Table(
        f"B90 on recorded drives by source, {ordered[0].detector_name}",
        ("policy", "all", *_by_source(ordered[0])),
        tuple(rows),
        (_NOTE, *told, *least_notes(rows), *tag_notes(one.tags for one in ordered)),
        whole=("all",),
    )


def _together(result: BudgetResult) -> BudgetResult:
    """Return the result on all recorded drives as one part."""
    rows = (row._replace(part=RECORDED) for row in result.rows if row.part in RECORDED_PARTS)
    return replace(result, rows=tuple(rows))


def _by_source(result: BudgetResult) -> dict[str, BudgetResult]:
    """Return the result on the drives of each source."""
    of = {row: source_of_world(row.world) for row in result.rows}
    return {
        source: replace(result, rows=tuple(row for row in result.rows if of[row] == source))
        for source in dict.fromkeys(of.values())
    }
