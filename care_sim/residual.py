"""Algorithm 2 of the paper: camera detections that no forecast explains, as wedges of cells."""

import numpy as np
from numpy.typing import NDArray

from care_sim.frames import Floats, turned
from care_sim.grid import Cells
from care_sim.types import Belief, ImageDetections, Rig, Tracks


def explained(detections: ImageDetections, tracks: Tracks, rig: Rig) -> NDArray[np.bool_]:
    """(n,) whether a same-class forecast centre projects into each image box (Eq. 2).

    Matching uses the full forecasts, never hulls that forgetting has shrunk. Centres are turned back
    by the yaw change since the picture was taken.
    """
    if not len(detections):
        return np.zeros(0, bool)
    pixels = _pixels(tracks.boxes[:, :3], detections, rig)
    boxes = detections.boxes[:, :, None]
    u, v = pixels[..., 0], pixels[..., 1]
    inside = (boxes[:, 0] <= u) & (u <= boxes[:, 2]) & (boxes[:, 1] <= v) & (v <= boxes[:, 3])
    result: NDArray[np.bool_] = (inside & (detections.classes[:, None] == tracks.classes)).any(axis=1)
    return result


def _pixels(points: Floats, detections: ImageDetections, rig: Rig) -> Floats:
    """(n, m, 2) where m points lie in the pictures of n detections; every picture is reckoned once."""
    of_detections = [*zip(detections.cameras.tolist(), detections.yaw_changes.tolist(), strict=True)]
    numbers = {picture: number for number, picture in enumerate(dict.fromkeys(of_detections))}
    cameras, yaw_changes = zip(*numbers, strict=True)
    seen = np.broadcast_to(points, (len(numbers), *points.shape))
    pixels, _ = rig.lenses.take(np.array(cameras)).project(turned(seen, np.array(yaw_changes)[:, None]))
    return pixels[[numbers[picture] for picture in of_detections]]


def wedges(detections: ImageDetections, rig: Rig) -> list[Cells]:
    """The depth-free wedge W(d) of every detection, turned by the yaw change since its picture."""
    if not len(detections):
        return []
    bundles = rig.lenses.take(detections.cameras).box_rays(detections.boxes)
    return rig.wedges(turned(bundles, -detections.yaw_changes[:, None]))


def camera_layers(belief: Belief, rig: Rig) -> tuple[list[Cells], list[Cells]]:
    """(U, M): the wedges of unexplained and of explained detections, in the order observed."""
    known = explained(belief.detections, belief.tracks, rig)
    cells = wedges(belief.detections, rig)
    unexplained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if not is_known]
    explained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if is_known]
    return unexplained_wedges, explained_wedges
