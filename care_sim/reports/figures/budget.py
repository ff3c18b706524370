"""Figures of first detection against the budget: a curve per policy for a sweep, a curve per unit
that fires as a whole for the study of hardware.
"""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.evaluation.censoring import Quartiles
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level_of, levels
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import setting_of
from care_sim.study.run_config import FULL, Row

BUDGET_FIGURES = ("{world}-budget",)
"""Every figure that a sweep can draw of a scenario."""


def sweep_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first-detection distance in metres against the budget: a figure for every scenario
    that was run without further conditions at several budgets, by name.
    """
    by_scenario: dict[str, list[Cell]] = {}
    for cell in levels(Frame(rows)):
        if not cell.setting.conditions:
            by_scenario.setdefault(cell.setting.world, []).append(cell)
    return {
        f"{by_scenario[world][0].setting.slug}-budget": _sweep_figure(world, by_scenario[world])
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


def _sweep_figure(world: str, cells: Sequence[Cell]) -> Figure:
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


FIRING_FIGURE = "firing"


def firing_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres of the policy that knows its hardware; none where it was not
    played at several budgets.
    """
    budgets = sorted({row["budget"] for row in rows if row["policy"] == AWARE})
    if len(budgets) < 2:
        return {}
    studies = {firing: Frame(own) for firing, own in rows_by_firing(rows).items()}
    settings = [*dict.fromkeys(setting_of(row) for each in studies.values() for row in each.rows)]
    panels = []
    for setting in settings:
        full = level_of(next(iter(studies.values())), (setting.for_full(), FULL, 1.0))
        found = full.detection.median if full else None
        heights = {
            firing: [height(level_of(study, (setting, AWARE, budget))) for budget in budgets]
            for firing, study in studies.items()
        }
        panels.append(
            Panel.by_budget(
                dict(setting.conditions).get("sensor", DEFAULT_SETUP),
                budgets,
                # A unit that does not divide this grid has no curve.
                heights={name: own for name, own in heights.items() if {*own} != {None}},
                lines={} if found is None else {FULL_SCAN: found},
            )
        )
    seeds = counted(len({row["seed"] for row in rows}), "seed")
    title = f"{settings[0].world}: {AWARE}, first detection (m, median of {seeds})"
    notes = ["budget (share of the units that fire)"]
    return {FIRING_FIGURE: curves_figure(title, panels, {}, notes, share=True)}
