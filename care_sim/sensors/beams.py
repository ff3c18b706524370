"""What fired cells return where pulses have strength and time: the bodies met, and the returns that
are strong enough to be noticed.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.return_settings import ReturnSettings
from care_sim.core.types import Scan
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.signal import Signal
from care_sim.sensors.surfaces import brightness
from care_sim.sensors.sweep import RollingSweep
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.linear_motion import LinearMotion


class Beams:
    """The beams of a LiDAR in a world, cast by the engine of a name. `motion` tells at any time how
    the world moves.
    """

    def __init__(
        self,
        world: BulletWorld,
        grid: AngularGrid,
        settings: ReturnSettings,
        engine: str,
        motion: Callable[[], LinearMotion],
    ):
        self._world = world
        self._grid = grid
        self._engine = ENGINES[engine](world, grid)
        self._signal = Signal(settings)
        rolling = settings.lidar_sweep_s > 0
        self._sweep = RollingSweep(grid, settings.lidar_sweep_s) if rolling else None
        self._compensates = settings.lidar_compensated
        self._motion = motion

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Scan, Integers]:
        """The returns of `cells` (n,), ascending, from the frame `sensor` of the keyframe, and the
        body behind each, NO_BODY where nothing returned.
        """
        if self._sweep is None:
            return self._cast_at_once(sensor, cells)
        motion = self._motion()
        now = self._world.primitives.poses
        ranges, intensities = np.empty(len(cells)), np.empty(len(cells))
        bodies = np.empty(len(cells), np.int64)
        for seconds, part in self._sweep.instants(cells):
            with self._world.placed(motion.poses(now, seconds)):
                scan, met = self._cast_at_once(motion.sensor(sensor, seconds), cells[part])
            ranges[part], intensities[part], bodies[part] = scan.ranges, scan.intensities, met
        return Scan(cells, ranges, intensities, self._sweep.seconds(cells)), bodies

    def compensated(self, scan: Scan, sensor: Frame) -> Scan:
        """The scan with the points of its returns as if the car had stood where it is in the frame
        `sensor` of the keyframe, if the ego's motion is compensated; else the scan.
        """
        if not self._compensates or scan.times is None:
            return scan
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, 0.0)
        points = self._grid.directions[scan.cells] * ranges[:, None]
        return replace(scan, points=self._motion().compensated(points, sensor, scan.times))

    def _cast_at_once(self, sensor: Frame, cells: Cells) -> tuple[Scan, Integers]:
        """The returns of cells that fire at one instant, at which the sensor is in this frame."""
        ranges, bodies = self._engine.cast(sensor, cells)
        rays = sensor.vectors_to_world(self._grid.directions[cells])
        bright = brightness(self._world.primitives, sensor.origin, rays, ranges, bodies)
        intensities = self._signal.intensities(bright, ranges)
        noticed = self._signal.suffices(intensities, ranges)
        scan = Scan(cells, np.where(noticed, ranges, np.inf), np.where(noticed, intensities, 0.0))
        return scan, np.where(noticed, bodies, NO_BODY)
