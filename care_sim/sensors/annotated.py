"""Sensor measurements of an annotated scene, with the object behind each return and each box.

The objects are truth: only scoring and privileged policies may read them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells
from care_sim.core.types import ImageDetections, Scan

NO_OBJECT = -1
"""Object number of a return or camera box that lies on no annotated object."""


@dataclass(frozen=True)
class Annotations:
    """The annotated objects of a keyframe. `objects` (n,) are numbers that stay the same through
    the film. `classes` (n,) index `care_sim.core.types.CLASSES`. `boxes` (n, 7) are in the sensor
    frame. All ranges are kept: the scoring selects.
    """

    objects: Integers
    classes: Integers
    boxes: Floats

    def __len__(self) -> int:
        return len(self.objects)

    def take(self, rows: Integers | Mask) -> "Annotations":
        """Return the rows chosen by index or mask."""
        return Annotations(self.objects[rows], self.classes[rows], self.boxes[rows])


NO_ANNOTATIONS = Annotations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 7)))


class SweepPose(NamedTuple):
    """Age and pose of one of several sweeps. The age is in seconds, 0 or more. The (4, 4) matrix
    moves points from the sensor's frame at the sweep into its frame at the keyframe, by the motion
    that the car knows.
    """

    lag_s: float
    matrix: Floats


AT_KEYFRAME = SweepPose(0.0, np.eye(4))


@dataclass(frozen=True)
class Cloud:
    """LiDAR returns. `cells` (P,) ascend; several returns of a recorded sweep may share a cell.
    `points` (P, 3) are in the sensor frame. `objects` (P,) are the annotated object behind each
    return, or NO_OBJECT. `intensities` (P,), 0 to 1, exist where pulses have strength
    (`care_sim.sensors.signal`) or a LiDAR recorded them. `times` (P,), seconds from the keyframe,
    exist where returns have their own (`care_sim.sensors.beams`). `shots` (P,) is how often a cell
    must be fired for each return; None where one shot is enough for all. `rings` (P,) number the
    lasers of a recorded LiDAR.

    `far` holds a recorded LiDAR's returns from beyond the reach of the grid. Only real detectors
    get them, since they were trained with them; rays, proxies and scores ignore them. If sweeps are
    gathered, `poses` are theirs, the keyframe's first, and `newest` is the keyframe's own sweep.
    """

    cells: Cells
    points: Floats
    objects: Integers
    intensities: Floats | None = None
    times: Floats | None = None
    shots: Floats | None = None
    rings: Integers | None = None
    far: "Cloud | None" = None
    poses: tuple["SweepPose", ...] = ()
    newest: "Cloud | None" = None

    def __len__(self) -> int:
        return len(self.cells)

    def to_shots(self, fired: Integers | None = None) -> "Cloud":
        """Return what cells give that are `fired` (N,) times, by default once each."""
        if self.shots is None:
            return self
        return self.take(self.shots <= (1 if fired is None else fired[self.cells]))

    @property
    def whole(self) -> "Cloud":
        """Return near and far returns as one cloud."""
        return self if self.far is None else joined([replace(self, far=None), self.far])

    def of_cells(self, answering: Mask) -> "Cloud":
        """Return the returns, near and far, of the `answering` (N,) cells."""
        own = self.take(answering[self.cells])
        return replace(own, far=self.far.take(answering[self.far.cells])) if self.far else own

    def take(self, kept: Mask) -> "Cloud":
        """Return the returns in a mask (P,). Far returns stay."""
        return self.ordered(np.flatnonzero(kept))

    def ordered(self, rows: Integers) -> "Cloud":
        """Return these rows in this order. Far returns stay."""
        return Cloud(
            self.cells[rows],
            self.points.take(rows, axis=0),
            self.objects[rows],
            None if self.intensities is None else self.intensities[rows],
            None if self.times is None else self.times[rows],
            None if self.shots is None else self.shots[rows],
            None if self.rings is None else self.rings[rows],
            self.far,
            self.poses,
            self.newest,
        )


NO_RETURNS = Cloud(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0, np.int64))


def joined(clouds: Sequence[Cloud]) -> Cloud:
    """Join clouds in the order of their cells, with the columns that all of them have. Far returns
    are joined in the same way.
    """
    cells = np.concatenate([cloud.cells for cloud in clouds])
    order = np.argsort(cells, kind="stable")
    far = [cloud.far for cloud in clouds if cloud.far is not None]
    return Cloud(
        cells[order],
        np.concatenate([cloud.points for cloud in clouds])[order],
        np.concatenate([cloud.objects for cloud in clouds])[order],
        _column([cloud.intensities for cloud in clouds], order),
        _column([cloud.times for cloud in clouds], order),
        _column([cloud.shots for cloud in clouds], order),
        _column([cloud.rings for cloud in clouds], order),
        far=joined(far) if far else None,
    )


def _column(columns: Sequence[Any], order: Integers) -> Any:
    known = [column for column in columns if column is not None]
    return np.concatenate(known)[order] if len(known) == len(columns) else None


def cloud_of(scan: Scan, objects: Integers, grid: Grid) -> Cloud:
    """Return a scan of a grid as a cloud; `objects` (n,) are those behind its rows."""
    returned = np.isfinite(scan.ranges)
    points = scan.points
    if points is None:
        points = grid.points(scan.cells, np.where(returned, scan.ranges, 0.0))
    rings = rings_of(scan.cells, grid)
    columns = (scan.intensities, scan.times)
    return Cloud(scan.cells, points, objects, *columns, rings=rings).take(returned)


def rings_of(cells: Cells, grid: Grid) -> Integers:
    """Return (n,) the lasers that fire the cells: grid rows, 0 the lowest, as nuScenes counts."""
    return grid.rows - 1 - cells // grid.columns


@dataclass(frozen=True)
class IdentifiedDetections:
    """Camera detections with the truth behind them. `objects` (n,) are the annotated object or the
    body behind each box, or NO_OBJECT. `visible` (n,) is the visible share of each object, where
    the source annotates it; otherwise boxes hold visible parts only. `pictures` (k, 2) are age
    (seconds) and yaw change (radians) of each camera's picture, where pictures are older than the
    keyframe.
    """

    detections: ImageDetections
    objects: Integers
    visible: Floats | None = None
    pictures: Floats | None = None

    def taken_at(self, pictures: Floats) -> "IdentifiedDetections":
        """Return the same detections with the ages and yaw changes of `pictures` (k, 2)."""
        rows = self.detections.rows().copy()
        rows[:, ImageDetections.TIMING] = pictures[self.detections.cameras]
        detections = ImageDetections.from_checked_rows(rows)
        return replace(self, detections=detections, pictures=pictures)

    def __len__(self) -> int:
        return len(self.objects)
