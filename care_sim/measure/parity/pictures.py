"""Engines compared in the pictures they draw for cameras."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.camera import Picture
from care_sim.sensors.engines import Engine
from care_sim.world.bullet import NO_BODY


class Pictures:
    """Pixels that show another body, and visible boxes that end elsewhere."""

    def __init__(self) -> None:
        self.pictures = self.pixels = self.other_pixels = 0
        self.boxes = self.other_boxes = self.in_one_only = 0
        self.widest_px = 0.0

    def compare(
        self, engine: Engine, reference: Engine, cameras: Sequence[PinholeCamera], sensor: Frame
    ) -> None:
        """Take in the pictures of a rig in the frame `sensor`."""
        for camera in cameras:
            window = (0, 0, camera.width, camera.height)
            drawn, expected = (
                which.body_ids(camera, sensor, window) for which in (engine, reference)
            )
            self.pictures += 1
            self.pixels += int(np.count_nonzero(expected != NO_BODY))
            self.other_pixels += int(np.count_nonzero(drawn != expected))
            self._compare_boxes(Picture.of(drawn), Picture.of(expected))

    def _compare_boxes(self, drawn: Picture, expected: Picture) -> None:
        both, one, other = np.intersect1d(drawn.bodies, expected.bodies, return_indices=True)
        apart = np.abs(drawn.boxes[one] - expected.boxes[other])
        self.boxes += len(expected.bodies)
        self.other_boxes += int(np.count_nonzero(apart.any(axis=1)))
        self.in_one_only += len(drawn.bodies) + len(expected.bodies) - 2 * len(both)
        self.widest_px = max(self.widest_px, float(apart.max(initial=0.0)))

    def figures(self) -> dict[str, Any]:
        """The counts."""
        return dict(vars(self))
