"""The figure of the vehicle study: what wedges hold of late boxes in turns, and how far forecasts
are off with an error of the pose.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from care_sim.reports.figures.styles import bare_axes
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
_PALETTE = ("#0072B2", "#D55E00", "#009E73")
"""From the palette of Okabe and Ito (2008), safe for the colour-blind."""
_NAMES = dict.fromkeys(group.name for group in (*EVIDENCE_GROUPS, *POSE_GROUPS))
_COLOURS = dict(zip(_NAMES, _PALETTE, strict=True))
"""Of the places, the same in both panels."""
_WITH, _WITHOUT = "o", "x"


def vehicle_figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Two panels, by name."""
    study = VehicleRows(rows)
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    held, off = figure.subplots(1, 2)
    _draw_held(held, study)
    _draw_errors(off, study)
    for axes in (held, off):
        bare_axes(axes, "0.9", "both")
        axes.invert_yaxis()
        axes.tick_params(labelsize=8)
        axes.legend(frameon=False, fontsize=8)
    return {VEHICLE_FIGURE: figure}


def _draw_held(axes: Axes, study: VehicleRows) -> None:
    late = [level for level in EVIDENCE_LEVELS if is_late(level)]
    for group in EVIDENCE_GROUPS:
        cells = [study.of(group, level, REFERENCE) for level in late]
        turned = np.array([total(rows, "turned_boxes") for rows in cells], float)
        turned[turned == 0] = np.nan
        for column, marker, how in (
            ("turned_held", _WITH, "compensated"),
            ("unturned_held", _WITHOUT, "without"),
        ):
            shares = 100 * np.array([total(rows, column) for rows in cells]) / turned
            label = f"{group.name}: {how}"
            axes.plot(shares, range(len(late)), marker, color=_COLOURS[group.name], label=label)
    axes.set_yticks(range(len(late)), [level.label for level in late])
    axes.set_xlim(0, 105)
    axes.set_xlabel("late boxes in turns whose wedge holds their object (%)", fontsize=8)


def _draw_errors(axes: Axes, study: VehicleRows) -> None:
    for group in POSE_GROUPS:
        means = [
            mean_over_forecasts(study.of(group, level, REFERENCE), "forecast_error_m")
            for level in POSE_LEVELS
        ]
        axes.plot(means, range(len(means)), _WITH, color=_COLOURS[group.name], label=group.name)
    axes.set_yticks(range(len(POSE_LEVELS)), [level.label for level in POSE_LEVELS])
    axes.set_xlabel("mean error of the forecasts (m)", fontsize=8)
