"""Algorithm 2 of the paper: camera detections that no forecast explains, as wedges of cells."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.belief import Belief
from care_sim.core.frames import Floats, turned
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections, Tracks


def explained(detections: ImageDetections, tracks: Tracks, rig: Rig) -> NDArray[np.bool_]:
    """(n,) whether a same-class forecast centre projects into each image box (Eq. 2)."""
    return explainers(detections, tracks, rig) >= 0


def explainers(detections: ImageDetections, tracks: Tracks, rig: Rig) -> Cells:
    """(n,) the first forecast, by row, that explains each image box (Eq. 2), -1 without one.

    Matching uses the full forecasts, never hulls that forgetting has shrunk. Centres are turned back
    by the yaw change since the picture was taken.
    """
    if not len(detections):
        return np.zeros(0, np.int64)
    from care_sim.core import pinhole_kernels as lenses

    columns = detections.boxes, detections.classes, detections.cameras, detections.yaw_changes
    forecasts = tracks.boxes[:, :3], tracks.classes
    found: Cells = lenses.explainers(_contiguous(*columns), _contiguous(*forecasts), rig.camera_models)
    return found


def wedges(detections: ImageDetections, rig: Rig) -> list[Cells]:
    """The depth-free wedge W(d) of every detection."""
    return rig.wedges(bundles(detections, rig)) if len(detections) else []


def bundles(detections: ImageDetections, rig: Rig) -> Floats:
    """(n, 9, 3) the rays through the image box of every detection, as of `PinholeCamera.box_rays`, turned by the yaw
    change since its picture.
    """
    rays = rig.camera_models.box_rays(detections.boxes, detections.cameras)
    return turned(rays, -detections.yaw_changes[:, None])


def camera_layers(belief: Belief, rig: Rig) -> tuple[list[Cells], list[Cells]]:
    """(U, M): the wedges of unexplained and of explained detections, in the order observed."""
    known = explained(belief.detections, belief.tracks, rig)
    cells = wedges(belief.detections, rig)
    unexplained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if not is_known]
    explained_wedges = [wedge for wedge, is_known in zip(cells, known, strict=True) if is_known]
    return unexplained_wedges, explained_wedges


def _contiguous(*columns: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """One layout, so that compiled code is compiled once."""
    return tuple(map(np.ascontiguousarray, columns))
