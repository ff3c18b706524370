"""Six cameras and a LiDAR around the car, which measure a world at one time.

The ring is that of nuScenes (Caesar et al. 2020, Fig. 4): front and sides 70 degrees wide and 55
degrees apart, the back 110 degrees wide, at the places of one of its calibrations, seen from
LIDAR_TOP.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells, Head
from care_sim.core.pinhole import PinholeCamera
from care_sim.sensors.annotated import NO_OBJECT, Cloud, IdentifiedDetections, rings_of
from care_sim.sensors.engines import Engine
from care_sim.sensors.pictures import (
    CAMERA_FROM_LIDAR,
    CAMERA_HEIGHT,
    CAMERA_WIDTH,
    faultless_detections,
)
from care_sim.world.bullet import NO_BODY, BulletWorld, PixelWindow


def _camera(yaw: float, position: tuple[float, float, float], width: float = 70.0) -> PinholeCamera:
    return PinholeCamera(CAMERA_WIDTH, CAMERA_HEIGHT, np.deg2rad(width), position, np.deg2rad(yaw))


SURROUND_CAMERAS = (
    _camera(0.0, CAMERA_FROM_LIDAR),
    _camera(55.0, (0.58, 0.49, -0.33)),
    _camera(-55.0, (0.61, -0.49, -0.34)),
    _camera(110.0, (0.09, 0.48, -0.25)),
    _camera(-110.0, (0.07, -0.48, -0.28)),
    _camera(180.0, (-0.92, 0.0, -0.26), width=110.0),
)
"""Front, front left, front right, back left, back right, back."""


class View(NamedTuple):
    """A picture: its camera, the frame of the sensor when it was taken, and the `window` of the
    camera's picture that it shows, all of it unless given.
    """

    camera: PinholeCamera
    sensor: Frame
    window: PixelWindow | None = None

    def window_on(self, boxes: Floats) -> PixelWindow:
        """The part of the window that holds every box (n, 7) of the frame."""
        left, top, right, bottom = self.camera.window_on(boxes)
        if self.window is None:
            return left, top, right, bottom
        first, highest, last, lowest = self.window
        return max(left, first), max(top, highest), min(right, last), min(bottom, lowest)


def surround_detections(
    engine: Engine,
    views: Sequence[View],
    sensor: Frame,
    labels: Mapping[int, int],
    boxes: Floats,
) -> IdentifiedDetections:
    """Return the detections in `views` of the bodies that `labels` maps to classes; `objects` are
    body ids. `boxes` (n, 7) are those of the bodies in the frame `sensor`. Nothing outside them is
    rendered.
    """
    tables = []
    for view in views:
        window = view.window_on(view.sensor.boxes_of(sensor, boxes))
        tables.append(engine.visible_boxes(view.camera, view.sensor, window))
    return faultless_detections(tables, labels)


def full_sweep(
    world: BulletWorld,
    grid: Grid,
    sensor: Frame,
    boxes: Floats,
    height_m: float,
    up: Floats | None = None,
) -> Cloud:
    """Return a full sweep from the frame `sensor`. `objects` are body ids; the road is NO_BODY, or
    the world's ground where it has one. `boxes` (n, 7) in the sensor frame hold all bodies.

    Rays are cast only where boxes are. All other rays can only meet the road, a plane `height_m`
    below the sensor. The plane is parallel to the sensor's x, y plane, or at a right angle to `up`
    (3,) in the sensor frame. In a world without ground the road hides nothing.
    """
    parts = [_own_sweep(world, head, sensor, boxes, height_m, up) for head in grid.heads]
    cells, ranges, bodies = map(np.concatenate, zip(*parts, strict=True))
    return Cloud(cells, grid.points(cells, ranges), bodies, rings=rings_of(cells, grid))


def _own_sweep(
    world: BulletWorld,
    head: Head,
    sensor: Frame,
    boxes: Floats,
    height_m: float,
    up: Floats | None,
) -> tuple[Cells, Floats, Integers]:
    """Cells, ranges and bodies of what one LiDAR gives to the sweep."""
    grid, own = head.grid, head.frame(sensor)
    # Hulls hold every cell that can hit a body, and their margin is room for rounding.
    covered = np.zeros(grid.size, dtype=bool)
    for hull in grid.hulls(head.boxes(boxes)):
        covered[hull] = True

    # Every other cell meets the road, at a distance that a formula gives. So does a ray that was
    # cast at a body and missed it.
    ranges = road_ranges(grid, height_m + head.place[2], up)
    bodies = np.full(grid.size, NO_BODY)
    directions = own.vectors_to_world(grid.directions[covered])
    cast, hit = world.cast(own.origin, directions, grid.range_m)
    ranges[covered] = np.where(hit == NO_BODY, ranges[covered], cast)
    bodies[covered] = hit
    (cells,) = np.nonzero(np.isfinite(ranges))
    return cells + head.first, ranges[cells], bodies[cells]


def road_ranges(grid: AngularGrid, height_m: float, up: Floats | None = None) -> Floats:
    """(N,) the distance along every ray to a plane `height_m` below the sensor, inf beyond the
    reach of a ray. The plane is at a right angle to `up` (3,), or to the sensor's z axis.
    """
    # A unit ray falls by this per metre; level or rising, it meets no road.
    fall = -(grid.directions[:, 2] if up is None else grid.directions @ up)
    ranges = np.divide(height_m, fall, out=np.full(grid.size, np.inf), where=fall > 0)
    return np.where(ranges <= grid.range_m, ranges, np.inf)


def numbers_of(bodies: Integers, numbers: Mapping[int, int]) -> Integers:
    """(n,) the number of the annotated object behind each body, NO_OBJECT where there is none."""
    # Few bodies return many rays: each is looked up once.
    found, rows = np.unique(bodies, return_inverse=True)
    return np.array([numbers.get(body, NO_OBJECT) for body in found.tolist()], dtype=np.int64)[rows]
