"""The paper's figure of a sweep: first detection against the budget, one curve per policy."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.cells import Cell, summarise
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.study.run_config import FULL, Row

BUDGET_FIGURES = ("{world}-budget",)
"""Every figure that a sweep can draw of a scenario."""


def sweep_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first-detection distance in metres against the budget: a figure for every scenario
    that was run without further conditions at several budgets, by name.
    """
    by_scenario: dict[str, list[Cell]] = {}
    for cell in summarise(rows):
        if not cell.setting.conditions:
            by_scenario.setdefault(cell.setting.world, []).append(cell)
    return {
        f"{by_scenario[world][0].setting.slug}-budget": _figure(world, by_scenario[world])
        for world in sorted(by_scenario)
        if len({cell.budget for cell in by_scenario[world] if cell.policy != FULL}) > 1
    }


def height(cell: Cell | None) -> float | None:
    """The median first detection in metres: None where it was not played, nan where the actor was
    not detected.
    """
    if cell is None:
        return None
    return math.nan if cell.detection.median is None else cell.detection.median


def _figure(world: str, cells: Sequence[Cell]) -> Figure:
    budgets = sorted({cell.budget for cell in cells if cell.policy != FULL})
    tags = {cell.policy: cell.tags for cell in cells if cell.policy != FULL}
    played = {(cell.policy, cell.budget): cell for cell in cells}
    full = next((cell.detection.median for cell in cells if cell.policy == FULL), None)
    panel = Panel.by_budget(
        "",
        budgets,
        label="first detection (m, median)",
        lines={} if full is None else {FULL_SCAN: full},
        heights={
            policy: [height(played.get((policy, budget))) for budget in budgets] for policy in tags
        },
        ends={
            policy: [
                _ends(cell.detection) if (cell := played.get((policy, budget))) else None
                for budget in budgets
            ]
            for policy in tags
        },
    )
    counts = sorted({cell.episodes for cell in cells})
    most = counted(counts[-1], "seed")
    seeds = most if len(counts) == 1 else f"{counts[0]} to {most}"
    notes = ["budget (share of cells fired)"]
    return curves_figure(f"{world}: {seeds} a point", [panel], tags, notes, bars="quartiles")


def _ends(found: Quartiles) -> tuple[float, float] | None:
    """Where the lower quartile is not detected, the bar reaches the bottom."""
    if found.median is None or found.high is None:
        return None
    return found.low or 0.0, found.high
