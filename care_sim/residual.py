"""Algorithm 2 of the paper: camera detections that no forecast explains, as wedges of cells."""

import numpy as np
from numpy.typing import NDArray

from care_sim.frames import turned
from care_sim.grid import AZIMUTH_MARGIN, ELEVATION_MARGIN, Cells, Floats
from care_sim.types import Belief, ImageDetections, Rig, Tracks


def explained(detections: ImageDetections, tracks: Tracks, rig: Rig) -> NDArray[np.bool_]:
    """(n,) whether a same-class forecast centre projects into each image box (Eq. 2).

    Matching uses the full forecasts, never hulls that forgetting has shrunk. Centres are turned back
    by the yaw change since the picture was taken.
    """
    result = np.zeros(len(detections), bool)
    for row, (camera, yaw_change) in enumerate(zip(detections.cameras, detections.yaw_changes, strict=True)):
        same_class = tracks.classes == detections.classes[row]
        pixels, depth = rig.cameras[camera].project(turned(tracks.boxes[same_class, :3], yaw_change))
        left, top, right, bottom = detections.boxes[row]
        u, v = pixels.T
        inside = (left <= u) & (u <= right) & (top <= v) & (v <= bottom)
        result[row] = bool(np.any(inside & (depth > 0)))
    return result


def wedges(
    detections: ImageDetections,
    rig: Rig,
    azimuth_margin: int = AZIMUTH_MARGIN,
    elevation_margin: int = ELEVATION_MARGIN,
) -> list[Cells]:
    """The depth-free wedge W(d) of every detection, turned by the yaw change since its picture."""
    if not len(detections):
        return []
    bundles = [
        turned(rig.cameras[camera].box_rays(box)[0], -yaw_change)
        for camera, box, yaw_change in zip(
            detections.cameras, detections.boxes, detections.yaw_changes, strict=True
        )
    ]
    return rig.grid.wedges(np.stack(bundles), azimuth_margin, elevation_margin)


def camera_layers(
    belief: Belief,
    rig: Rig,
    azimuth_margin: int = AZIMUTH_MARGIN,
    elevation_margin: int = ELEVATION_MARGIN,
) -> tuple[list[Cells], list[Cells]]:
    """(U, M): the wedges of unexplained and of explained detections, in the order observed."""
    known = explained(belief.detections, belief.tracks, rig)
    cells = wedges(belief.detections, rig, azimuth_margin, elevation_margin)
    unexplained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if not is_known]
    explained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if is_known]
    return unexplained_wedges, explained_wedges

