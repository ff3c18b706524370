"""What the open loop replays: the keyframes of a scene, the same for every policy.

A film is made once, from a generated street, a recorded drive whose boxes become bodies, or recorded clouds. Nothing
in it depends on a policy. It holds truth; policies see of it what `care_sim.core.types.Belief` carries.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from care_sim.core.frames import Floats, Frame
from care_sim.core.grid import Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import Ego, ImageDetections

NOBODY = -1
"""The object behind a return or a camera box that lies on no annotated object."""


@dataclass(frozen=True)
class Annotations:
    """The annotated objects of a keyframe: `objects` (n,) numbers that hold for the whole film, `classes` (n,) into
    `care_sim.core.types.CLASSES`, `boxes` (n, 7) in the sensor frame. All ranges; the scoring chooses.
    """

    objects: Cells
    classes: Cells
    boxes: Floats

    def __len__(self) -> int:
        return len(self.objects)


NO_ANNOTATIONS = Annotations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 7)))


@dataclass(frozen=True)
class Cloud:
    """Returns: `cells` (P,) ascending (several returns of a recorded sweep may share one), `points` (P, 3) in the
    sensor frame, `objects` (P,) the annotated object that each lies on or NOBODY.
    """

    cells: Cells
    points: Floats
    objects: Cells

    def __len__(self) -> int:
        return len(self.cells)

    def take(self, kept: NDArray[np.bool_]) -> "Cloud":
        """Some of the returns, by mask (P,)."""
        rows = np.flatnonzero(kept)
        return Cloud(self.cells[rows], self.points.take(rows, axis=0), self.objects[rows])


@dataclass(frozen=True)
class Sights:
    """What the unimpaired cameras see: `detections`, age 0, and `objects` (n,) the annotated object behind each box or
    NOBODY.
    """

    detections: ImageDetections
    objects: Cells


@dataclass(frozen=True)
class Shot:
    """One keyframe: `time_s` from the start, `token` by which its source names it, the LiDAR's `sensor` frame, the
    car's own motion, and everything that could be seen.
    """

    time_s: float
    token: str
    sensor: Frame
    ego: Ego
    annotations: Annotations
    sights: Sights
    cloud: Cloud


@dataclass(frozen=True, eq=False)
class Film:
    """A scene: its name, the cameras of its car, the LiDAR's height above the road, seconds between keyframes.

    `hidden` are the objects that its source annotates at the first keyframe though no sensor tells of them there:
    neither a return nor a pixel. No shot annotates them, so nobody has to find them; they were present all the same.
    """

    name: str
    cameras: tuple[PinholeCamera, ...]
    sensor_height_m: float
    keyframe_s: float
    shots: tuple[Shot, ...]
    hidden: Annotations = NO_ANNOTATIONS
