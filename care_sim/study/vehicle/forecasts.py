"""How far forecasts are off, and how much of that the margin of Eq. 4 holds."""

import numpy as np

from care_sim.core.forgetting import VEHICLE_SIGMA_M, uncertainty_margin
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.study.run_config import Row


class Forecasts:
    """Errors of the forecasts of tracks that have a velocity, against where their objects are."""

    def __init__(self) -> None:
        self._errors_m: list[float] = []
        self._held = np.zeros(2, np.int64)
        """Forecasts whose error in azimuth lies within Eq. 4's margin, and within a full hull's."""

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        tracks = loop.belief.tracks.take(loop.belief.tracks.hits > 1)
        if not len(tracks):
            return
        true = loop.true_boxes(tracks)
        self._errors_m += np.hypot(*(tracks.boxes - true)[:, :2].T).tolist()
        azimuths, wanted = (np.arctan2(boxes[:, 1], boxes[:, 0]) for boxes in (tracks.boxes, true))
        away = np.abs((azimuths - wanted + np.pi) % (2 * np.pi) - np.pi)
        columns = away / loop.rig.grid.column_width
        margin = uncertainty_margin(VEHICLE_SIGMA_M, tracks.boxes, loop.rig)
        self._held += [
            int((columns <= margin).sum()),
            int((columns <= loop.rig.azimuth_margin).sum()),
        ]

    def columns(self) -> Row:
        """As columns of a row."""
        errors = self._errors_m
        eq4, full = self._held.tolist()
        return {
            "forecasts": len(errors),
            "forecast_error_m": float(np.mean(errors)) if errors else None,
            "forecast_error_p95_m": float(np.percentile(errors, 95)) if errors else None,
            "forecasts_in_eq4": eq4,
            "forecasts_in_margin": full,
        }
