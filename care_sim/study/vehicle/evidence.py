"""How old the camera's evidence is, and what the compensation of the car's turn does to it. And how
far forecasts are off.
"""

import numpy as np

from care_sim.core.forgetting import VEHICLE_SIGMA_M, uncertainty_margin
from care_sim.core.residual import wedges
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.study.run_config import Row


class Evidence:
    """Ages of the pictures that decisions rest on, and of the boxes taken before a turn those whose
    wedge holds their object: its centre, as it stands at the decision.

    A box counts as turned where the car has since turned by a column or more; compensation can move
    no other. Truth, that is which object lies behind a box, is read for the scoring alone.
    """

    def __init__(self) -> None:
        self._ages_ms: list[int] = []
        self._boxes = 0
        self._turned = np.zeros(3, np.int64)
        """Turned boxes, and those whose wedge holds the object with and without compensation."""

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        detections = loop.belief.detections
        if not len(detections):
            return
        # All boxes of a keyframe are of the newest picture that has arrived.
        self._ages_ms.append(round(1e3 * float(detections.ages[0])))
        known = loop.detected_bodies != NO_OBJECT
        self._boxes += int(known.sum())
        turned = known & (np.abs(detections.yaw_changes) >= loop.rig.grid.column_width)
        if not turned.any():
            return
        boxes = loop.world.boxes_of(loop.detected_bodies[turned])
        cells = loop.rig.grid.cells_at(loop.sensor.boxes_to_local(boxes)[:, :3])
        held = [
            sum(
                bool(np.isin(own, wedge).any())
                for own, wedge in zip(cells, each.take(turned), strict=True)
            )
            for each in (wedges(detections, loop.rig), wedges(detections.unturned(), loop.rig))
        ]
        self._turned += [int(turned.sum()), *held]

    def columns(self) -> Row:
        """As columns of a row."""
        turned, held, held_unturned = self._turned.tolist()
        return {
            "evidence_ages_ms": tuple(self._ages_ms),
            "boxes": self._boxes,
            "turned_boxes": turned,
            "turned_held": held,
            "unturned_held": held_unturned,
        }


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
