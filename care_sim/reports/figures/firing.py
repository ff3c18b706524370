"""The figure of the study of hardware: first detection against the budget, a panel per sensor
set-up and a curve per unit that fires as a whole.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.reports.cells import StudyCells
from care_sim.reports.figures.budget import height
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.designs.firing import AWARE, rows_by_firing
from care_sim.study.rows.reading import setting_of
from care_sim.study.run_config import FULL, Row

FIRING_FIGURE = "firing"


def firing_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Median first detection in metres of the policy that knows its hardware; none where it was not
    played at several budgets.
    """
    budgets = sorted({row["budget"] for row in rows if row["policy"] == AWARE})
    if len(budgets) < 2:
        return {}
    studies = {firing: StudyCells(own) for firing, own in rows_by_firing(rows).items()}
    settings = [*dict.fromkeys(setting_of(row) for each in studies.values() for row in each.rows)]
    panels = []
    for setting in settings:
        full = next(iter(studies.values())).cell((setting.for_full(), FULL, 1.0))
        found = full.detection.median if full else None
        heights = {
            firing: [height(study.cell((setting, AWARE, budget))) for budget in budgets]
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
