"""Figures of what errors do: faults as they grow, and the vehicle study's late boxes in turns and
errors of the pose.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

from matplotlib.figure import Figure

from care_sim.base.errors import counted
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level_of
from care_sim.reports.figures.curves import FULL_SCAN, Panel, curves_figure
from care_sim.reports.tables.faults import policies_of
from care_sim.reports.tables.vehicle import VehicleRows, mean_over_forecasts, total
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, faults_alone
from care_sim.study.designs.variants import Place
from care_sim.study.designs.vehicle import (
    EVIDENCE_GROUPS,
    EVIDENCE_LEVELS,
    POSE_GROUPS,
    POSE_LEVELS,
    is_late,
)
from care_sim.study.run_config import FULL, REFERENCE, Row


@dataclass(frozen=True)
class CurveMeasure:
    """What a figure shows of a cell; `read` gives None where there is nothing to show."""

    name: str
    label: str
    read: Callable[[Cell], float | None]

    def value(self, cell: Cell | None) -> float | None:
        """None for a cell that was not played, nan for one without a value."""
        if cell is None:
            return None
        found = self.read(cell)
        return math.nan if found is None else found


MEASURES = (
    CurveMeasure("detection", "first detection, median, m", lambda cell: cell.detection.median),
    CurveMeasure(
        "braked", "episodes with braking, %", lambda cell: 100.0 * cell.braked / cell.episodes
    ),
    CurveMeasure(
        "clearance",
        "clearance, median, m",
        lambda cell: cell.clearance.median if cell.clearance else None,
    ),
)
FAULT_FIGURES = tuple(
    f"faults-{place.scenario}-{measure.name}" for place in FAULT_PLACES for measure in MEASURES
)
"""Every figure that the study can draw."""


def fault_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """A figure for every place and measure, by name, with a panel for every fault."""
    study = Frame(faults_alone(rows))
    made = [_figure(study, place, measure) for place, measure in product(FAULT_PLACES, MEASURES)]
    return dict(zip(FAULT_FIGURES, made, strict=True))


def _figure(study: Frame, place: Place, measure: CurveMeasure) -> Figure:
    panels = [
        Panel(
            fault.title,
            [level.label for level in fault.levels],
            {
                FULL_SCAN if policy == FULL else policy: [
                    measure.value(level_of(study, level.key(place, policy)))
                    for level in fault.levels
                ]
                for policy in policies_of(study)
            },
            unit=fault.unit,
        )
        for fault in FAULTS
    ]
    seeds = counted(len({row["seed"] for row in study.rows}), "seed")
    return curves_figure(f"{place}, {seeds}: {measure.label}", panels, study.tags, share=True)


VEHICLE_FIGURE = "vehicle"


def vehicle_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Two panels, by name."""
    study = VehicleRows(rows)
    late = [level for level in EVIDENCE_LEVELS if is_late(level)]
    held = {
        f"{group.name}: {how}": [
            _share(study.of(group, level, REFERENCE), column) for level in late
        ]
        for group in EVIDENCE_GROUPS
        for column, how in (("turned_held", "compensated"), ("unturned_held", "without"))
    }
    off = {
        group.name: [
            mean_over_forecasts(study.of(group, level, REFERENCE), "forecast_error_m")
            for level in POSE_LEVELS
        ]
        for group in POSE_GROUPS
    }
    panels = [
        Panel(title, [level.label for level in levels], heights)
        for title, levels, heights in (
            ("late boxes in turns whose wedge holds their object (%)", late, held),
            ("mean error of the forecasts (m)", POSE_LEVELS, off),
        )
    ]
    return {VEHICLE_FIGURE: curves_figure("", panels, {})}


def _share(rows: Sequence[Row], column: str) -> float | None:
    """In per cent of the boxes in turns; None without any."""
    turned = total(rows, "turned_boxes")
    return 100.0 * total(rows, column) / turned if turned else None
