"""What fired cells return where pulses have strength: the bodies met, and the returns that are
strong enough to be noticed.
"""

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.return_settings import ReturnSettings
from care_sim.core.types import Scan
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.signal import Signal
from care_sim.sensors.surfaces import brightness
from care_sim.world.bullet import NO_BODY, BulletWorld


class Beams:
    """The beams of a LiDAR in a world, cast by the engine of a name."""

    def __init__(
        self, world: BulletWorld, grid: AngularGrid, settings: ReturnSettings, engine: str
    ):
        self._world = world
        self._grid = grid
        self._engine = ENGINES[engine](world, grid)
        self._signal = Signal(settings)

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Scan, Integers]:
        """The returns of `cells` (n,), ascending, from the frame `sensor`, and the body behind
        each, NO_BODY where nothing returned.
        """
        ranges, bodies = self._engine.cast(sensor, cells)
        rays = sensor.vectors_to_world(self._grid.directions[cells])
        bright = brightness(self._world.primitives, sensor.origin, rays, ranges, bodies)
        intensities = self._signal.intensities(bright, ranges)
        noticed = self._signal.suffices(intensities, ranges)
        scan = Scan(cells, np.where(noticed, ranges, np.inf), np.where(noticed, intensities, 0.0))
        return scan, np.where(noticed, bodies, NO_BODY)
