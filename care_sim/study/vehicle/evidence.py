"""How old the camera's evidence is, and what the compensation of the car's turn does to it."""

import numpy as np

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
