"""Annotated boxes as bodies of a world, and what its sensors make of them."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from care_sim.film import Annotations, Cloud, Sights
from care_sim.frames import Floats, Frame
from care_sim.grid import AngularGrid
from care_sim.sensors.surround import SURROUND_CAMERAS, cloud_of, look_around, numbers_of
from care_sim.types import CLASSES
from care_sim.world.bodies import sized
from care_sim.world.bullet import BulletWorld


@dataclass(frozen=True)
class Prop:
    """An annotated box: its `number` in the film, its class name (None outside the five classes), length, width and
    height, and the frame in its centre, seen from the sensor.
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
    def foot(self) -> Frame:
        """The frame in the middle of its bottom face."""
        return self.frame.holding(np.array([0.0, 0.0, -self.size[2] / 2]))


def shoot(
    props: Sequence[Prop], sensor: Frame, height_m: float, grid: AngularGrid
) -> tuple[Annotations, Sights, Cloud]:
    """What a LiDAR in the frame `sensor` and the cameras around it see of `props`, every cell fired.

    The road is a plane `height_m` below the sensor, parallel to the car. It returns the rays that no body stopped and
    hides nothing: real roads undulate, and a plane in the world would bury what stands where they fall.
    """
    reported = [prop for prop in props if prop.label is not None]
    annotations = _annotations(reported)
    with closing(BulletWorld(ground=False)) as world:
        bodies = {id(prop): _add(world, prop, sensor) for prop in props}
        numbers = {bodies[id(prop)]: prop.number for prop in reported}
        labels = {bodies[id(prop)]: CLASSES.index(str(prop.label)) for prop in reported}
        seen = look_around(world, SURROUND_CAMERAS, sensor, labels, annotations.boxes)
        ranges, hit = world.cast(sensor.origin, sensor.vectors_to_world(grid.directions), grid.range_m)
    sights = Sights(seen.detections, numbers_of(seen.objects, numbers))
    on_road = np.where(np.isinf(ranges), road_ranges(grid, height_m), ranges)
    return annotations, sights, cloud_of(grid, on_road, numbers_of(hit, numbers))


def road_ranges(grid: AngularGrid, height_m: float) -> Floats:
    """(N,) the distance along every ray to a plane `height_m` below the sensor, inf beyond the reach of a ray."""
    fall = -grid.directions[:, 2]
    ranges = np.divide(height_m, fall, out=np.full(grid.size, np.inf), where=fall > 0)
    return np.where(ranges <= grid.range_m, ranges, np.inf)


def _annotations(props: Sequence[Prop]) -> Annotations:
    boxes = np.array([prop.box for prop in props]).reshape(-1, 7)
    classes = [CLASSES.index(str(prop.label)) for prop in props]
    numbers = [prop.number for prop in props]
    return Annotations(np.array(numbers, dtype=np.int64), np.array(classes, dtype=np.int64), boxes)


def _add(world: BulletWorld, prop: Prop, sensor: Frame) -> int:
    foot = prop.foot
    return world.add(sized("prop", prop.label, prop.size), sensor.holding(foot.origin, foot.rotation))
