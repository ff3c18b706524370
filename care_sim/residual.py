"""Algorithm 2 of the paper: camera detections that no forecast explains, as wedges of cells."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from care_sim.frames import turned
from care_sim.grid import Cells
from care_sim.pinhole import PinholeCamera
from care_sim.types import Belief, ImageDetections, Rig, Tracks


def explained(detections: ImageDetections, tracks: Tracks, rig: Rig) -> NDArray[np.bool_]:
    """(n,) whether a same-class forecast centre projects into each image box (Eq. 2).

    Matching uses the full forecasts, never hulls that forgetting has shrunk. Centres are turned back
    by the yaw change since the picture was taken.
    """
    result = np.zeros(len(detections), bool)
    centres = np.broadcast_to(tracks.boxes[:, :3], (len(detections), len(tracks), 3))
    centres = turned(centres, detections.yaw_changes[:, None])
    for rows, camera in _cameras(detections, rig):
        u, v = np.moveaxis(camera.project(centres[rows])[0], -1, 0)
        left, top, right, bottom = detections.boxes[rows].T[..., None]
        inside = (left <= u) & (u <= right) & (top <= v) & (v <= bottom)
        result[rows] = np.any(inside & (detections.classes[rows, None] == tracks.classes), axis=1)
    return result


def wedges(detections: ImageDetections, rig: Rig) -> list[Cells]:
    """The depth-free wedge W(d) of every detection, turned by the yaw change since its picture."""
    bundles = np.empty((len(detections), 9, 3))
    for rows, camera in _cameras(detections, rig):
        bundles[rows] = camera.box_rays(detections.boxes[rows])
    return rig.wedges(turned(bundles, -detections.yaw_changes[:, None]))


def camera_layers(belief: Belief, rig: Rig) -> tuple[list[Cells], list[Cells]]:
    """(U, M): the wedges of unexplained and of explained detections, in the order observed."""
    known = explained(belief.detections, belief.tracks, rig)
    cells = wedges(belief.detections, rig)
    unexplained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if not is_known]
    explained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if is_known]
    return unexplained_wedges, explained_wedges


def _cameras(detections: ImageDetections, rig: Rig) -> Iterator[tuple[NDArray[np.bool_], PinholeCamera]]:
    """Every camera with the mask of its detections."""
    for index in np.unique(detections.cameras).tolist():
        yield detections.cameras == index, rig.cameras[index]
