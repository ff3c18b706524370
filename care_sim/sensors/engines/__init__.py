"""Engines find the body that a ray hits, its distance, and the body that a pixel shows. `bullet` is
the reference. `fast` is compiled and agrees within the differences that `make parity` measures.
"""

import inspect
from collections.abc import Callable
from typing import Protocol

import numpy as np

from care_sim.base.checks import check_known
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid, GridStack
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.sensors.engines.picture_kernels import (
    View,
    bodies_in_view,
    boxes_of_window,
    render_bodies,
)
from care_sim.sensors.engines.ray_kernels import cast_rays
from care_sim.world.bullet import FAR_M, NO_BODY, BulletWorld, PixelWindow


class Engine(Protocol):
    """Casts the rays of one grid at the bodies of one world, and draws these for cameras."""

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Fire `cells` (n,) from the frame `sensor`. Returns ranges (n,) in metres, inf without a
        hit within the grid's reach, and body ids (n,), NO_BODY without a hit.
        """

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Return the body id of each pixel in a window of `camera`, NO_BODY without a body. See
        `care_sim.world.bullet.BulletWorld.body_ids`.
        """

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Return (n, 6) the bodies in a window of `camera`, ascending by id. Columns: id, box
        (left, top, right, bottom), number of pixels. The box holds all pixels of the body, counted
        from the corner of the picture.
        """


class Bullet:
    """The rays and pictures of PyBullet: the reference, about 20 times slower than `fast`."""

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world = world
        self._grid = grid

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `Engine`."""
        directions = sensor.vectors_to_world(self._grid.directions[cells])
        return self._world.cast(sensor.origin, directions, self._grid.range_m)

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `Engine`."""
        return self._world.body_ids(camera, sensor, window)

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The bodies in a window; see `Engine`."""
        return boxes_of_window(self.body_ids(camera, sensor, window), window)


class Fast:
    """Compiled kernels over the same bodies; `make parity` compares them with `bullet` ray by ray.

    The first call on a machine compiles for some seconds; later processes read the compiled code
    from a cache.
    """

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        self._world = world
        self._cells = grid.size
        self._reach = float(grid.range_m)
        # Read at every call: an array that is copied can be written, for which compiled code would
        # be compiled again.
        self._grid = grid
        self._tilt = grid.tilt if grid.is_tilted else None
        self._spacing = (*grid.spacing,)

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `Engine`."""
        # The kernel finds the cells of a window by bisection, so it needs them ascending. Unsorted
        # cells are sorted, and the answers put back in their order.
        if (cells[1:] < cells[:-1]).any():
            order = np.argsort(cells)
            ranges, ids = self.cast(sensor, cells[order])
            back = np.argsort(order)
            return ranges[back], ids[back]
        # One layout of the array, so that compiled code is compiled once; it checks no bounds.
        cells = np.require(cells, np.int64, ("C", "W"))
        if len(cells) and not 0 <= cells[0] <= cells[-1] < self._cells:
            raise IndexError(
                f"cells must lie in 0..{self._cells - 1}, got {cells[0]} to {cells[-1]}"
            )
        return self._cast_ascending(sensor, cells)

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `Engine`."""
        return render_bodies(self._view(camera, sensor, window))

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The bodies in a window; see `Engine`."""
        return bodies_in_view(self._view(camera, sensor, window))

    def _view(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> View:
        """Return the inputs of the picture kernels."""
        world = self._world
        lens = camera.focal, camera.width / 2, camera.height / 2
        depths = NEAR_M, FAR_M
        placed = camera.stance(sensor)
        return placed, lens, window, depths, world.polyhedra.tables, world.primitives.poses

    def _cast_ascending(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        world = self._world
        # The fan is about the grid's own axes: the rays are cast from a frame that has them.
        if self._tilt is not None:
            sensor = sensor.holding(np.zeros(3), self._tilt)
        pose = (sensor.x, sensor.y, sensor.z, sensor.yaw, sensor.roll, sensor.pitch)
        return cast_rays(
            cells,
            self._reach,
            self._grid.fan,
            self._spacing,
            np.array(pose, float),
            world.primitives.tables,
            world.primitives.poses,
            world.ground,
        )


class HeadEngines:
    """One engine per LiDAR of a stack, all made by `make`. Cameras are in the frame of the first
    LiDAR, so its engine draws their pictures.
    """

    def __init__(
        self,
        make: Callable[[BulletWorld, AngularGrid], Engine],
        world: BulletWorld,
        grid: GridStack,
    ):
        self._grid = grid
        self._engines = [(head, make(world, head.grid)) for head in grid.heads]
        _, first = self._engines[0]
        self.body_ids = first.body_ids
        self.visible_boxes = first.visible_boxes

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `Engine`."""
        ranges = np.full(len(cells), np.inf)
        ids = np.full(len(cells), NO_BODY)
        lidars = self._grid.lidars_of(cells)
        for number, (head, engine) in enumerate(self._engines):
            own = np.flatnonzero(lidars == number)
            ranges[own], ids[own] = engine.cast(head.frame(sensor), cells[own] - head.first)
        return ranges, ids


ENGINES: dict[str, Callable[[BulletWorld, AngularGrid], Engine]] = {"bullet": Bullet, "fast": Fast}
"""Engine makers by name, each for the grid of one LiDAR."""


def make_engine(name: str, world: BulletWorld, grid: Grid) -> Engine:
    """The engine of a name for a world and the LiDARs of a grid."""
    make = ENGINES[name]
    return make(world, grid) if isinstance(grid, AngularGrid) else HeadEngines(make, world, grid)


def check_engine(name: str) -> None:
    """Raise InvalidInput for a name that is not an engine."""
    check_known("engine", name, ENGINES)


def engine_lines() -> list[str]:
    """One line per engine: its name and what it is."""
    abouts = {name: inspect.getdoc(made) or "" for name, made in ENGINES.items()}
    firsts = {name: about.partition("\n\n")[0] for name, about in abouts.items()}
    return [f"{name:12} {' '.join(first.split())}" for name, first in firsts.items()]


def engine_names() -> list[str]:
    """The names of engines."""
    return [*ENGINES]
