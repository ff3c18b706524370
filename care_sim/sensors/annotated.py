"""What sensors measure of a scene that somebody annotated, with the object behind each return and
each box.

The objects are truth: for the scoring and privileged policies.
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
"""The object behind a return or a camera box that lies on no annotated object."""


@dataclass(frozen=True)
class Annotations:
    """The annotated objects of a keyframe: `objects` (n,) numbers that hold for the whole film,
    `classes` (n,) into `care_sim.core.types.CLASSES`, `boxes` (n, 7) in the sensor frame. All
    ranges; the scoring chooses.
    """

    objects: Integers
    classes: Integers
    boxes: Floats

    def __len__(self) -> int:
        return len(self.objects)

    def take(self, rows: Integers | Mask) -> "Annotations":
        """Some of the rows, by index or mask."""
        return Annotations(self.objects[rows], self.classes[rows], self.boxes[rows])


NO_ANNOTATIONS = Annotations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 7)))


class SweepPose(NamedTuple):
    """One of several sweeps: seconds since it was taken, 0 or more, and the (4, 4) matrix that
    moves points from the sensor's frame then into its frame at the keyframe, as far as the car
    knows its own motion.
    """

    lag_s: float
    matrix: Floats


AT_KEYFRAME = SweepPose(0.0, np.eye(4))


@dataclass(frozen=True)
class Cloud:
    """Returns: `cells` (P,) ascending (several returns of a recorded sweep may share one), `points`
    (P, 3) in the sensor frame, `objects` (P,) the annotated object that each lies on or NO_OBJECT,
    `intensities` (P,), 0 to 1, where pulses have strength (`care_sim.sensors.signal`) or a LiDAR
    recorded it, and `times` (P,), seconds from the keyframe, where they have their own
    (`care_sim.sensors.beams`). `shots` (P,) is how often a cell must be fired for each to return;
    None where once is enough for all. `rings` (P,) number the lasers of a recorded LiDAR. `ranges`
    (P,) are metres from the LiDAR, in clouds without `points`.

    `far` are the returns of a recorded LiDAR from beyond the reach of the grid. A real detector
    gets them too, since it was trained with them; no ray, no proxy and no score counts them.
    Of gathered sweeps, `poses` are theirs, the keyframe's first, and `newest` is the keyframe's
    own sweep.
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
    ranges: Floats | None = None
    newest: "Cloud | None" = None

    def __len__(self) -> int:
        return len(self.cells)

    def to_shots(self, fired: Integers | None = None) -> "Cloud":
        """The returns of cells that are `fired` (N,) times; once each, unless it is given."""
        if self.shots is None:
            return self
        return self.take(self.shots <= (1 if fired is None else fired[self.cells]))

    @property
    def whole(self) -> "Cloud":
        """The returns near and far together."""
        return self if self.far is None else joined([replace(self, far=None), self.far])

    def of_cells(self, answering: Mask) -> "Cloud":
        """The returns, near and far, of the cells that are `answering` (N,)."""
        own = self.take(answering[self.cells])
        return replace(own, far=self.far.take(answering[self.far.cells])) if self.far else own

    def take(self, kept: Mask) -> "Cloud":
        """Some of the returns, by mask (P,); those from far away stay."""
        return self.ordered(np.flatnonzero(kept))

    def ordered(self, rows: Integers) -> "Cloud":
        """The returns in these rows, in this order; those from far away stay."""
        return Cloud(
            self.cells[rows],
            self.points.take(rows, axis=0) if self.ranges is None else self.points,
            self.objects[rows],
            None if self.intensities is None else self.intensities[rows],
            None if self.times is None else self.times[rows],
            None if self.shots is None else self.shots[rows],
            None if self.rings is None else self.rings[rows],
            self.far,
            self.poses,
            None if self.ranges is None else self.ranges[rows],
            self.newest,
        )


NO_RETURNS = Cloud(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0, np.int64))


def joined(clouds: Sequence[Cloud]) -> Cloud:
    """The returns of clouds in the order of their cells, with the columns that all of them have;
    those from far away joined in the same way.
    """
    cells = np.concatenate([cloud.cells for cloud in clouds])
    order = np.argsort(cells, kind="stable")
    far = [cloud.far for cloud in clouds if cloud.far is not None]
    points = np.concatenate([cloud.points for cloud in clouds])
    ranges = _column([cloud.ranges for cloud in clouds], order)
    return Cloud(
        cells[order],
        points[order] if ranges is None else points,
        np.concatenate([cloud.objects for cloud in clouds])[order],
        _column([cloud.intensities for cloud in clouds], order),
        _column([cloud.times for cloud in clouds], order),
        _column([cloud.shots for cloud in clouds], order),
        _column([cloud.rings for cloud in clouds], order),
        far=joined(far) if far else None,
        ranges=ranges,
    )


def _column(columns: Sequence[Any], order: Integers) -> Any:
    known = [column for column in columns if column is not None]
    return np.concatenate(known)[order] if len(known) == len(columns) else None


def cloud_of(scan: Scan, objects: Integers, grid: Grid) -> Cloud:
    """The returns of a scan of a grid; `objects` (n,) are those behind its rows."""
    returned = np.isfinite(scan.ranges)
    points = scan.points
    if points is None:
        points = grid.points(scan.cells, np.where(returned, scan.ranges, 0.0))
    rings = rings_of(scan.cells, grid)
    columns = (scan.intensities, scan.times)
    return Cloud(scan.cells, points, objects, *columns, rings=rings).take(returned)


def pointless_cloud(scan: Scan, objects: Integers) -> Cloud:
    """As `cloud_of`, with cells, objects and ranges alone: `points` is empty."""
    (rows,) = np.nonzero(np.isfinite(scan.ranges))
    return Cloud(scan.cells[rows], np.empty((0, 3)), objects[rows], ranges=scan.ranges[rows])


def rings_of(cells: Cells, grid: Grid) -> Integers:
    """(n,) the lasers that fire the cells: its rows, 0 the lowest, as nuScenes counts."""
    return grid.rows - 1 - cells // grid.columns


@dataclass(frozen=True)
class IdentifiedDetections:
    """Camera detections, with `objects` (n,) the annotated object or the body behind each box, or
    NO_OBJECT. `visible` (n,) is the share of each object that its picture shows, where the source
    annotates it; else boxes are those of what is visible. `pictures` (k, 2) are age (seconds) and
    yaw change (radians) of the picture of each camera, where they are not all of the keyframe.
    """

    detections: ImageDetections
    objects: Integers
    visible: Floats | None = None
    pictures: Floats | None = None

    def taken_at(self, pictures: Floats) -> "IdentifiedDetections":
        """The same detections on `pictures` (k, 2) of such ages and yaw changes."""
        rows = self.detections.rows().copy()
        rows[:, ImageDetections.TIMING] = pictures[self.detections.cameras]
        detections = ImageDetections.from_checked_rows(rows)
        return replace(self, detections=detections, pictures=pictures)

    def __len__(self) -> int:
        return len(self.objects)
