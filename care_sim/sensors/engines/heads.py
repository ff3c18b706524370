"""The engines of several LiDARs as one: each casts its own cells, from where it stands."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import GridStack
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.world.bullet import NO_BODY, BulletWorld, PixelWindow


class _Engine(Protocol):
    """See `care_sim.sensors.engines.Engine`."""

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]: ...

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers: ...

    def visible_boxes(
        self, camera: PinholeCamera, sensor: Frame, window: PixelWindow
    ) -> Integers: ...


class HeadEngines:
    """An engine of one kind, which `make` makes, for each LiDAR of a stack. The cameras are told in
    the frame of the first, so that its engine draws their pictures.
    """

    def __init__(
        self,
        make: Callable[[BulletWorld, AngularGrid], _Engine],
        world: BulletWorld,
        grid: GridStack,
    ):
        self._grid = grid
        self._engines = [(head, make(world, head.grid)) for head in grid.heads]

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges and body ids; see `care_sim.sensors.engines.RayEngine`."""
        ranges = np.full(len(cells), np.inf)
        ids = np.full(len(cells), NO_BODY)
        lidars = self._grid.lidars_of(cells)
        for number, (head, engine) in enumerate(self._engines):
            own = np.flatnonzero(lidars == number)
            ranges[own], ids[own] = engine.cast(head.frame(sensor), cells[own] - head.first)
        return ranges, ids

    def body_ids(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """Body ids of pixels; see `care_sim.sensors.engines.Engine`."""
        _, first = self._engines[0]
        return first.body_ids(camera, sensor, window)

    def visible_boxes(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> Integers:
        """The bodies in a window; see `care_sim.sensors.engines.Engine`."""
        _, first = self._engines[0]
        return first.visible_boxes(camera, sensor, window)
