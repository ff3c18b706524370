"""Where the objects in camera boxes are, by the typical heights of their classes."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.residual import ray_starts, wedge_rays
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.world.bodies import CATALOGUE

ON_FOOT = np.isin(CLASSES, ("pedestrian", "bicycle"))
"""By class: people on foot and on bicycles."""
_HEIGHTS_M = np.array([CATALOGUE[name].size[2] for name in CLASSES])
"""The typical body of every class; `CATALOGUE` has their sources."""


def box_places(detections: ImageDetections, rig: Rig) -> Floats:
    """Return the places (n, 3) of what the boxes show, in the sensor frame, in metres. At this
    range the typical height of the class appears as high as the box.
    """
    if not len(detections):
        return np.empty((0, 3))
    pixels = np.maximum(detections.boxes[:, 3] - detections.boxes[:, 1], 1.0)
    focal = rig.camera_models.focals[detections.cameras]
    # Depth is along the optical axis; the ray through the middle of the box is longer.
    depths = focal * _HEIGHTS_M[detections.classes] / pixels
    places: Floats = depths[:, None] * wedge_rays(detections, rig)[:, 0]
    starts = ray_starts(detections, rig)
    return places if starts is None else places + starts
