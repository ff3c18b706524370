"""Annotated boxes as bodies of a world, and what its sensors make of them."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sensors.surround import (
    SURROUND_CAMERAS,
    View,
    full_sweep,
    numbers_of,
    surround_detections,
)
from care_sim.world.bodies import sized
from care_sim.world.bullet import BulletWorld


@dataclass(frozen=True)
class AnnotatedBody:
    """An annotated box: its `number` in the film, its class name (None outside the five classes),
    length, width and height, and the frame in its centre, seen from the sensor.
    """

    number: int
    label: str | None
    size: tuple[float, float, float]
    frame: Frame

    @property
    def box(self) -> tuple[float, ...]:
        """Centre, size and heading in the sensor frame."""
        return (*self.frame.origin.tolist(), *self.size, self.frame.yaw)

    @property
    def bounds(self) -> tuple[float, ...]:
        """The box along the sensor's axes that holds it, however it is turned."""
        # Each of its own axes reaches along a sensor's axis by the absolute value of their cosine.
        extents = np.abs(self.frame.rotation.as_matrix()) @ self.size
        return (*self.frame.origin.tolist(), *extents.tolist(), 0.0)

    @property
    def foot(self) -> Frame:
        """The frame in the middle of its bottom face."""
        return self.frame.holding(np.array([0.0, 0.0, -self.size[2] / 2]))


def sense(
    annotated: Sequence[AnnotatedBody],
    sensor: Frame,
    height_m: float,
    grid: Grid,
    cameras: tuple[PinholeCamera, ...] = SURROUND_CAMERAS,
    views: Sequence[View] | None = None,
    up: Floats | None = None,
) -> tuple[Annotations, IdentifiedDetections, Cloud]:
    """Return what LiDARs in the frame `sensor` and its `cameras` see of `annotated`, every cell
    fired. `views` are the pictures of cameras that took them at other moments, in their place.

    The road is a plane `height_m` below the sensor, parallel to the car: at a right angle to `up`
    (3,) in the sensor frame, or to the sensor's z axis. It hides nothing, because real roads
    undulate: a plane in the world would bury what stands where they fall.
    """
    reported = [one for one in annotated if one.label is not None]
    annotations = annotations_of(reported)
    with closing(BulletWorld(ground=False)) as world:
        # All of them occlude. Those of the five classes have a number in the film.
        bodies = {id(one): _add(world, one, sensor) for one in annotated}
        numbers = {bodies[id(one)]: one.number for one in reported}
        labels = {bodies[id(one)]: CLASSES.index(str(one.label)) for one in reported}
        # A recorded sensor leans, and an upright box does not hold the body that leans back in it.
        shown = annotations.boxes if views is None else _table([one.bounds for one in reported])
        views = [View(camera, sensor) for camera in cameras] if views is None else views
        seen = surround_detections(world, views, sensor, labels, shown)
        bounds = _table([one.bounds for one in annotated])
        swept = full_sweep(world, grid, sensor, bounds, height_m, up)
    identified = IdentifiedDetections(seen.detections, numbers_of(seen.objects, numbers))
    return (
        annotations,
        identified,
        Cloud(swept.cells, swept.points, numbers_of(swept.objects, numbers)),
    )


def annotations_of(annotated: Sequence[AnnotatedBody]) -> Annotations:
    """The annotations of `annotated`, all of the five classes."""
    boxes = _table([one.box for one in annotated])
    classes = [CLASSES.index(str(one.label)) for one in annotated]
    numbers = [one.number for one in annotated]
    return Annotations(np.array(numbers, dtype=np.int64), np.array(classes, dtype=np.int64), boxes)


def _table(boxes: list[tuple[float, ...]]) -> Floats:
    return np.array(boxes, dtype=float).reshape(-1, 7)


def _add(world: BulletWorld, one: AnnotatedBody, sensor: Frame) -> int:
    foot = one.foot
    return world.add(sized("prop", one.label, one.size), sensor.holding(foot.origin, foot.rotation))
