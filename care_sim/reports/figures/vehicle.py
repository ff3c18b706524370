"""The figure of the vehicle study: what wedges hold of late boxes in turns, and how far forecasts
are off with an error of the pose.
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from care_sim.reports.figures.curves import Panel, curves_figure
from care_sim.reports.vehicle.rows import VehicleRows, mean_over_forecasts, total
from care_sim.study.designs.vehicle import (
    EVIDENCE_GROUPS,
    EVIDENCE_LEVELS,
    POSE_GROUPS,
    POSE_LEVELS,
    is_late,
)
from care_sim.study.run_config import REFERENCE, Row

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
