"""What fired cells return where beams have strength, width and time: the bodies met, and the
returns that are strong enough to be noticed.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import ReturnSettings
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.types import Scan
from care_sim.sensors.bundle import bundle
from care_sim.sensors.echoes import Echoes, echoes_of, reported
from care_sim.sensors.engines import Engine, make_engine
from care_sim.sensors.signal import Signal
from care_sim.sensors.surfaces import brightness
from care_sim.sensors.sweep import RollingSweep
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.motions import LinearMotion


class Beams:
    """The beams of a LiDAR in a world, cast by the engine of a name. `motion` tells at any time how
    the world moves.
    """

    def __init__(
        self,
        world: BulletWorld,
        grid: Grid,
        settings: ReturnSettings,
        engine: str,
        motion: Callable[[], LinearMotion],
    ):
        self._world = world
        self._grid = grid
        divergence = settings.lidar_divergence_mrad
        # The rays of each beam: a grid and an engine for the first, the second, ...
        grids = bundle(grid, divergence) if divergence else [grid]
        self._rays = [(one, make_engine(engine, world, one)) for one in grids]
        self._kept = settings.lidar_returns
        self._signal = Signal(settings)
        rolling = settings.lidar_sweep_s > 0
        self._sweep = RollingSweep(grid, settings.lidar_sweep_s) if rolling else None
        self._compensates = settings.lidar_compensated
        self._motion = motion

    def cast(
        self, sensor: Frame, cells: Cells, shots: Integers | None = None
    ) -> tuple[Scan, Integers]:
        """The returns of `cells` (n,), ascending, from the frame `sensor` of the keyframe, and the
        body behind each, NO_BODY where nothing returned. `shots` (N,) says of all cells of the grid
        how often they fire; each of `cells` once, unless given.
        """
        if self._sweep is None:
            return self._scan(cells, self._cast_at_once(sensor, cells, shots))
        motion = self._motion()
        now = self._world.primitives.poses
        parts = [Echoes.none()]
        for seconds, places in self._sweep.instants(cells):
            with self._world.placed(motion.poses(now, seconds)):
                echoes = self._cast_at_once(motion.sensor(sensor, seconds), cells[places], shots)
            parts.append(echoes._replace(beams=places[echoes.beams]))
        return self._scan(cells, Echoes.joined(parts))

    def compensated(self, scan: Scan, sensor: Frame) -> Scan:
        """The scan with the points of its returns as if the car had stood where it is in the frame
        `sensor` of the keyframe, if the ego's motion is compensated; else the scan.
        """
        if not self._compensates or scan.times is None:
            return scan
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, 0.0)
        points = self._grid.points(scan.cells, ranges)
        return replace(scan, points=self._motion().compensated(points, sensor, scan.times))

    def _cast_at_once(self, sensor: Frame, cells: Cells, shots: Integers | None) -> Echoes:
        """What is noticed of cells that fire at one instant, at which the sensor is in this frame;
        `Echoes.beams` are places in `cells`.
        """
        met = [self._meet(sensor, cells, *ray) for ray in self._rays]
        if len(met) > 1:
            ranges, intensities, bodies = map(np.stack, zip(*met, strict=True))
            echoes = echoes_of(ranges, intensities, bodies)
        else:
            echoes = Echoes(np.arange(len(cells)), *met[0])
        fired = 1 if shots is None else shots[cells[echoes.beams]]
        noticed = self._signal.suffices(echoes.intensities, echoes.ranges, fired)
        echoes = echoes.take(np.flatnonzero(noticed))
        return reported(echoes, self._kept) if len(met) > 1 else echoes

    def _meet(
        self, sensor: Frame, cells: Cells, grid: Grid, engine: Engine
    ) -> tuple[Floats, Floats, Integers]:
        """Ranges (n,), intensities (n,) and bodies (n,) of one ray of every cell."""
        ranges, bodies = engine.cast(sensor, cells)
        rays = sensor.vectors_to_world(grid.directions[cells])
        origins = sensor.origin + sensor.vectors_to_world(grid.origins_of(cells))
        bright = brightness(self._world.primitives, origins, rays, ranges, bodies)
        return ranges, self._signal.intensities(bright, ranges), bodies

    def _scan(self, cells: Cells, echoes: Echoes) -> tuple[Scan, Integers]:
        """The echoes as a scan, with a row for each cell that has none."""
        silent = np.setdiff1d(np.arange(len(cells)), echoes.beams)
        count = len(silent)
        nothing = Echoes(silent, np.full(count, np.inf), np.zeros(count), np.full(count, NO_BODY))
        rows = Echoes.joined([echoes, nothing])
        rows = rows.take(np.argsort(rows.beams, kind="stable"))
        fired = cells[rows.beams]
        times = None if self._sweep is None else self._sweep.seconds(fired)
        return Scan(fired, rows.ranges, rows.intensities, times), rows.bodies
