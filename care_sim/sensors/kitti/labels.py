"""Inputs of the detector's formulas for each object in a picture, in pixels of KITTI's focal
length.

KITTI's labels are boxes of whole objects, hidden parts included. On labels of all levels of
occlusion the median width is that of the projected 3D box (cars 1.00, cyclists 1.02). So is the
height (0.99). So here an object's box is its projected 3D box, cut at the picture's edges.
Pedestrians and two-wheelers fill a share of its width (`UNHIDDEN`): the sides move inwards by that.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.pinhole import (
    NEAR_M,
    CameraModel,
    MountedCameras,
    PinholeCamera,
    box_spans,
    mounted_model,
)
from care_sim.core.rig import LIDAR_HEIGHT_M
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.camera_errors import UNHIDDEN
from care_sim.sensors.kitti.numbers import CAR, FOCAL_PX, KIND_OF

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
# Compiled code can only read module-level constants.
_CLASS, _LEFT, _CAMERA = ImageDetections.CLASS, ImageDetections.LEFT, ImageDetections.CAMERA
_CAR_CLASS = CLASSES.index("car")


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


def pictures_of(cameras: Sequence[PinholeCamera]) -> Floats:
    """Return (k, 5) width, height, middle column and horizon row of the cameras' pictures, and the
    camera's height over KITTI's. Assumes the LiDAR LIDAR_HEIGHT_M above the road and no roll of
    cameras.
    """
    rows = [
        (each.width, each.height, each.width / 2, each.height / 2 + each.focal * np.tan(each.pitch))
        for each in cameras
    ]
    scales = np.array([FOCAL_PX / each.focal for each in cameras])
    pixels: Floats = np.array(rows, float).reshape(-1, 4) * scales[:, None]
    heights = np.array([LIDAR_HEIGHT_M + each.position[2] for each in cameras])
    return np.column_stack([pixels, heights / KITTI_CAMERA_M])


@compiled()
def labels_of(
    rows: Floats,
    places: Integers,
    visible: Floats,
    boxes: Floats,
    cameras: MountedCameras,
    world: int,
) -> Labels:
    """The objects of faultless detections `rows` (n, 9) in a world, at `places` (n,) among the 3D
    `boxes` (m, 7) in the sensor frame. `visible` are their annotated shares (n,), or empty: then
    they are read off the boxes.
    """
    count = len(rows)
    whole, shares, edges = np.empty((4, count), np.int64), np.empty((3, count)), (count, 4)
    labels = Labels(
        whole[0],
        whole[1],
        np.empty(edges),
        np.empty(edges, np.bool_),
        whole[2],
        shares[0],
        shares[1],
        shares[2],
        whole[3],
        places,
    )
    depths = np.empty(count)
    for n in range(count):
        number = int(rows[n, _CAMERA])
        labels.cameras[n] = number
        share = visible[n] if len(visible) else math.nan
        seen = mounted_model(cameras, world, number), cameras.sizes[number]
        depths[n] = _lay_label(n, rows[n], share, boxes[places[n] : places[n] + 1], seen, labels)
    labels.cover[:] = covered(labels.boxes, depths, labels.cameras)
    return labels


@compiled()
def _lay_label(
    n: int,
    row: Floats,
    visible: float,
    box: Floats,
    seen_by: tuple[CameraModel, Integers],
    labels: Labels,
) -> float:
    """Fill the label n of an object with a 3D box (1, 7), but for its cover; return its depth. A
    `visible` share of NaN is read off the boxes. A camera of a width and height sees it.
    """
    camera, size = seen_by
    label = int(row[_CLASS])
    kind, unhidden = KINDS[label], UNHIDDEN_SHARES[label]
    labels.classes[n], labels.kinds[n] = label, kind
    scale = FOCAL_PX / camera.focal
    whole, clipped, pixels = np.empty(4), labels.boxes[n], np.empty(4)
    span = box_spans(box, camera, NEAR_M)
    for j in range(4):
        # A box wholly behind the camera spans nothing.
        whole[j] = (0.0 if math.isnan(span[0, j]) else span[0, j]) * scale
        pixels[j] = row[_LEFT + j] * scale
        clipped[j] = min(max(whole[j], 0.0), size[j % 2] * scale)
        labels.cut[n, j] = whole[j] != clipped[j]
    area = _area(clipped)
    labels.beyond[n] = 1 - area / max(_area(whole), 1.0)
    share = _area(pixels) / max(area * unhidden, 1.0) if math.isnan(visible) else visible
    labels.levels[n] = 0
    for least in LEAST_SHARES:
        labels.levels[n] += share < least

    # The sides move inwards, where the picture does not cut them.
    inwards = 0.0 if kind == CAR else (1 - unhidden) / 2 * (clipped[2] - clipped[0])
    clipped[0] += 0.0 if labels.cut[n, 0] else inwards
    clipped[2] -= 0.0 if labels.cut[n, 2] else inwards

    x, y, z = box[0, 0] - camera.position[0], box[0, 1] - camera.position[1], box[0, 2]
    labels.metres[n] = math.hypot(x, y) if label == _CAR_CLASS else 0.0
    axis = camera.axes[0]
    return float(axis[0] * x + axis[1] * y + axis[2] * (z - camera.position[2]))


@compiled()
def _area(box: Floats) -> float:
    """Square pixels of an image box (4,)."""
    return float(max(box[2] - box[0], 0.0) * max(box[3] - box[1], 0.0))


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
