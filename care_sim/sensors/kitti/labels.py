"""Inputs of the detector's formulas for each object in a picture, in pixels of KITTI's focal
length.

KITTI's labels are boxes of whole objects, hidden parts included. On labels of all levels of
occlusion the median width is that of the projected 3D box (cars 1.00, cyclists 1.02). So is the
height (0.99). So here an object's box is its projected 3D box, cut at the picture's edges.
Pedestrians and two-wheelers fill a share of its width (`UNHIDDEN`): the sides move inwards by that.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import LIDAR_HEIGHT_M
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera_errors import UNHIDDEN
from care_sim.sensors.false_boxes import box_areas
from care_sim.sensors.kitti.numbers import CAR, KIND_OF

UNHIDDEN_SHARES = np.array([UNHIDDEN[name] for name in CLASSES])
KINDS = np.array([KIND_OF[name] for name in CLASSES])
LEAST_SHARES = (0.8, 0.45)
"""Visible shares from which an object is not and partly occluded. They are assumed: midway between
the means of KITTI's levels, 0.97, 0.60 and 0.31.
"""
KITTI_CAMERA_M = 1.65
"""Height of KITTI's camera above the road, metres."""
NEARER_M = 0.3
"""Only what is nearer by more than this covers an object."""
_POINTS = 12
"""Points per side of the grid on which the covered share is counted."""


class Labels(NamedTuple):
    """The n objects that pictures show, with the columns of the fit."""

    classes: Integers
    """(n,) places in `care_sim.core.types.CLASSES`."""
    kinds: Integers
    """(n,) measured kinds (`care_sim.sensors.kitti.numbers`)."""
    boxes: Floats
    """(n, 4) left, top, right, bottom in their picture."""
    cut: Mask
    """(n, 4) the edges that the picture cuts."""
    levels: Integers
    """(n,) KITTI's levels of occlusion."""
    beyond: Floats
    """(n,) the share beyond the picture."""
    metres: Floats
    """(n,) planar distance from the camera, 0 where it does not count."""
    cover: Floats
    """(n,) the share of the box that boxes of nearer objects cover."""
    cameras: Integers
    """(n,) the picture of each."""
    places: Integers
    """(n,) the place of each among all objects that may ever be seen."""


def pictures_of(cameras: Sequence[PinholeCamera], focal_px: float) -> Floats:
    """Return (k, 5) width, height, middle column and horizon row of the cameras' pictures, and the
    camera's height over KITTI's. Lengths are in pixels of the focal length `focal_px`. Assumes the
    LiDAR LIDAR_HEIGHT_M above the road and no roll of cameras.
    """
    rows = [
        (each.width, each.height, each.width / 2, each.height / 2 + each.focal * np.tan(each.pitch))
        for each in cameras
    ]
    scales = np.array([focal_px / each.focal for each in cameras])
    pixels: Floats = np.array(rows, float).reshape(-1, 4) * scales[:, None]
    heights = np.array([LIDAR_HEIGHT_M + each.position[2] for each in cameras])
    return np.column_stack([pixels, heights / KITTI_CAMERA_M])


def labels_of(
    seen: IdentifiedDetections,
    boxes: Floats,
    places: Integers,
    cameras: Sequence[PinholeCamera],
    focal_px: float,
) -> Labels:
    """The objects of faultless detections `seen` (n,); `boxes` (n, 7) are their 3D boxes in the
    sensor frame.
    """
    detections = seen.detections
    kinds = KINDS[detections.classes]
    scales = np.array([focal_px / camera.focal for camera in cameras])[detections.cameras, None]
    sizes = np.array([(camera.width, camera.height) * 2 for camera in cameras])
    whole = np.empty((len(seen), 4))
    metres, depths = np.empty((2, len(seen)))
    for number in set(detections.cameras.tolist()):
        camera = cameras[number]
        (own,) = np.nonzero(detections.cameras == number)
        whole[own] = camera.project_boxes(boxes[own])
        away = boxes[own, :3] - camera.position
        metres[own], depths[own] = np.hypot(away[:, 0], away[:, 1]), away @ camera.axes[0]
    whole = np.nan_to_num(whole) * scales
    limits = sizes[detections.cameras] * scales
    clipped = np.clip(whole, 0.0, limits)
    cut = whole != clipped
    areas = box_areas(clipped)
    metres[detections.classes != CLASSES.index("car")] = 0.0
    narrowed = _narrowed(clipped, cut, kinds, detections.classes)
    return Labels(
        detections.classes,
        kinds,
        narrowed,
        cut,
        _levels(seen, detections.boxes * scales, areas),
        1 - areas / np.maximum(box_areas(whole), 1.0),
        metres,
        covered(narrowed, depths, detections.cameras),
        detections.cameras,
        places,
    )


def _narrowed(boxes: Floats, cut: Mask, kinds: Integers, classes: Integers) -> Floats:
    share = np.where(kinds == CAR, 1.0, UNHIDDEN_SHARES[classes])
    inwards = (1 - share) / 2 * (boxes[:, 2] - boxes[:, 0])
    narrowed = boxes.copy()
    narrowed[:, 0] += np.where(cut[:, 0], 0.0, inwards)
    narrowed[:, 2] -= np.where(cut[:, 2], 0.0, inwards)
    return narrowed


def _levels(seen: IdentifiedDetections, pixels: Floats, areas: Floats) -> Integers:
    shares = seen.visible
    if shares is None:
        unhidden = np.maximum(areas * UNHIDDEN_SHARES[seen.detections.classes], 1.0)
        shares = box_areas(pixels) / unhidden
    levels: Integers = np.sum([shares < least for least in LEAST_SHARES], axis=0)
    return levels


@compiled()
def covered(boxes: Floats, depths: Floats, cameras: Integers) -> Floats:
    """(n,) the share of image boxes (n, 4) that nearer boxes of their picture cover, counted on
    144 points; `depths` (n,) in metres.
    """
    shares = np.zeros(len(boxes))
    for i in range(len(boxes)):
        hidden = np.zeros((_POINTS, _POINTS), np.bool_)
        for j in range(len(boxes)):
            if cameras[j] == cameras[i] and depths[j] < depths[i] - NEARER_M:
                _hide(boxes[i], boxes[j], hidden)
        shares[i] = hidden.sum() / _POINTS**2
    return shares


@compiled()
def _hide(box: Floats, nearer: Floats, hidden: Mask) -> None:
    """Set the points of a box that a nearer one holds."""
    if nearer[0] >= box[2] or nearer[2] <= box[0] or nearer[1] >= box[3] or nearer[3] <= box[1]:
        return
    for row in range(_POINTS):
        y = box[1] + (box[3] - box[1]) * (row + 0.5) / _POINTS
        if not nearer[1] < y < nearer[3]:
            continue
        for column in range(_POINTS):
            x = box[0] + (box[2] - box[0]) * (column + 0.5) / _POINTS
            if nearer[0] < x < nearer[2]:
                hidden[row, column] = True
