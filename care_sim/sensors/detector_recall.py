"""How often a camera detector finds an object, by its height in the picture and its visible share.

The height is that of the object's whole 3D box as the picture shows it, hidden or not: the box of
its eight corners, cut at the picture's edges. The visible share is the area of the box round the
visible pixels over the area that this box has when nothing hides the object, which is a share of
its whole box (`UNHIDDEN`). CityPersons defines visibility alike, by boxes (Zhang et al. 2017).
Where a source tells the share itself, as nuScenes does in levels, that one counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.box_pool import box_areas

UNHIDDEN = {"car": 0.98, "truck": 0.99, "bus": 1.0, "bicycle": 0.80, "pedestrian": 0.84}
"""The share of its whole box that the box round an object's pixels has when nothing hides it: the
medians of the catalogue's bodies, seen from all sides at 10 to 30 m. The corners of a turned box
stay empty, of slender bodies most.
"""
_UNHIDDEN = np.array([UNHIDDEN[name] for name in CLASSES])


@dataclass(frozen=True)
class RecallTable:
    """Measured recall at some heights and visible shares, linear between them.

    `heights` (h,) in pixels and `shares` (s,) ascend; `recalls` (s, h). Recall falls to 0 from the
    first height to height 0 and from the first share to share 0; beyond the last ones it stays.
    """

    heights: tuple[float, ...]
    shares: tuple[float, ...]
    recalls: tuple[tuple[float, ...], ...]

    def at(self, heights: Floats, shares: Floats) -> Floats:
        """(n,) the recall at `heights` (n,) in pixels and visible `shares` (n,)."""
        known = (0.0, *self.heights)
        by_height = [np.interp(heights, known, (0.0, *row)) for row in self.recalls]
        levels = np.stack([np.zeros(len(heights)), *by_height])
        # Where each share lies between two of the table: the lower one, and how far beyond it.
        places = np.interp(shares, (0.0, *self.shares), np.arange(len(levels)))
        lower = np.minimum(places.astype(np.int64), len(levels) - 2)
        objects = np.arange(len(heights))
        low, high = levels[lower, objects], levels[lower + 1, objects]
        recalls: Floats = low + (places - lower) * (high - low)
        return recalls


def seen_as(
    seen: IdentifiedDetections, boxes: Floats, cameras: Sequence[PinholeCamera], focal_px: float
) -> tuple[Floats, Floats]:
    """(n,) heights in pixels of a picture of the focal length `focal_px`, and (n,) visible shares,
    of the detections `seen` of objects with the sensor-frame `boxes` (n, 7).
    """
    heights = np.empty(len(seen))
    shares = np.empty(len(seen))
    for number, camera in enumerate(cameras):
        (own,) = np.nonzero(seen.detections.cameras == number)
        whole = whole_boxes(camera, boxes[own])
        heights[own] = (whole[:, 3] - whole[:, 1]) * focal_px / camera.focal
        shares[own] = _shares(seen.detections, own, whole)
    return heights, shares if seen.visible is None else seen.visible


def whole_boxes(camera: PinholeCamera, boxes: Floats) -> Floats:
    """(n, 4) what whole 3D boxes (n, 7) span in the picture, cut at its edges."""
    limits = np.tile([camera.width, camera.height], 2)
    # What is wholly behind the camera spans nothing.
    return np.clip(np.nan_to_num(camera.project_boxes(boxes), nan=0.0), 0.0, limits)


def _shares(detections: ImageDetections, rows: Integers, whole: Floats) -> Floats:
    unhidden = box_areas(whole) * _UNHIDDEN[detections.classes[rows]]
    # Many an object shows more than the median of its kind. No box is smaller than a pixel.
    shares: Floats = np.minimum(box_areas(detections.boxes[rows]) / np.maximum(unhidden, 1.0), 1.0)
    return shares
