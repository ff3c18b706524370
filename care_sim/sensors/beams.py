"""Returns of fired cells whose beams have strength, width and time. Finds the bodies that rays meet
and keeps the returns that are strong enough.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import ReturnSettings
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.core.types import Scan
from care_sim.sensors.engines import Engine, make_engine
from care_sim.sensors.signal import Echoes, Signal, brightness, echoes_of, reported
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.motions import LinearMotion

MOST_INSTANTS = 64
"""Instants per sweep; neighbouring columns share one. In 0.1 s and 512 columns an instant is at
most 0.7 ms from a column's own, in which 30 m/s are 2 cm.
"""


class RollingSweep:
    """The instants at which the columns of a grid fire in a sweep of `sweep_s` seconds."""

    def __init__(self, grid: Grid, sweep_s: float):
        self._columns = grid.columns
        # The last columns come first: azimuths grow to the left, and the sensor turns to the right.
        columns = np.arange(grid.columns)
        own = -sweep_s * (columns + 0.5) / grid.columns
        self._group_of: Integers = columns * min(MOST_INSTANTS, grid.columns) // grid.columns
        # A group fires at the mean instant of its columns.
        self._seconds = np.bincount(self._group_of, own) / np.bincount(self._group_of)

    def instants(self, cells: Cells) -> list[tuple[float, Integers]]:
        """Return the instants at which `cells` (n,) fire, seconds from the keyframe (negative).
        Each comes with the places in `cells` that fire then.
        """
        groups = self._group_of[cells % self._columns]
        found = np.unique(groups).tolist()
        return [(float(self._seconds[one]), np.flatnonzero(groups == one)) for one in found]

    def seconds(self, cells: Cells) -> Floats:
        """Return (n,) when each of `cells` fires, seconds from the keyframe."""
        return self._seconds[self._group_of[cells % self._columns]]


_RING = np.sqrt(7 / 12)
"""Distance of the six outer rays from the middle one, in half beams. So the seven equal rays have
the variance of an evenly lit disc: 1/4 of the half beam squared along each axis.
"""
_CUT_APART = 1e-9
"""Radians between rows that are cut: rows of a grid descend."""


def bundle(grid: Grid, divergence_mrad: float) -> list[Grid]:
    """Return grids whose cells hold one ray of each cell's beam: the grid itself, then its ring.
    `divergence_mrad` is the angle between opposite edges of the beam in milliradians. In a row at
    elevation e beams are narrower across by cos(e).
    """
    if not isinstance(grid, AngularGrid):
        each = [_bundle(one, divergence_mrad) for one in grid.grids]
        return [replace(grid, grids=rays) for rays in zip(*each, strict=True)]
    return [*_bundle(grid, divergence_mrad)]


def _bundle(grid: AngularGrid, divergence_mrad: float) -> list[AngularGrid]:
    """Return the bundle of one LiDAR."""
    radius = _RING * divergence_mrad / 2000
    angles = np.arange(6) * np.pi / 3
    around = zip(
        (radius * np.cos(angles)).tolist(), (radius * np.sin(angles)).tolist(), strict=True
    )
    return [grid, *(_shifted(grid, across, up) for across, up in around)]


def _shifted(grid: AngularGrid, across: float, up: float) -> AngularGrid:
    """Return the grid turned left by `across` about its own axes and raised by `up`, radians."""
    from scipy.spatial.transform import Rotation

    raised = _raised(grid, up)
    turned = grid.heading + across
    if not grid.is_tilted:
        return replace(raised, heading=float(np.remainder(turned + np.pi, 2 * np.pi) - np.pi))
    # A tilt is relative to the heading, so it changes with the heading.
    mount = grid.tilt * Rotation.from_euler("Z", turned)
    heading, lowered, roll = mount.as_euler("ZYX").tolist()
    return replace(raised, heading=heading, pitch=-lowered, roll=roll)


def _raised(grid: AngularGrid, up: float) -> AngularGrid:
    """Return the grid with its rows raised by `up` radians, at most to straight up or down."""
    rows = grid.elevations + up
    apart = _CUT_APART * np.arange(grid.rows)
    held = np.clip(rows, apart[::-1] - np.pi / 2, np.pi / 2 - apart)
    # Where rows are cut the others keep their places, so that not all are evenly spaced.
    listed = tuple(held.tolist()) if grid.listed or (held != rows).any() else ()
    return replace(grid, top=float(held[0]), bottom=float(held[-1]), listed=listed)


class Beams:
    """The beams of a LiDAR in a world, cast by a named engine. `motion` moves the world to any
    time.
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
        # Each ray of a beam has its own grid and engine.
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
        """Return the returns of ascending `cells` (n,) and the body behind each, NO_BODY without a
        return. `sensor` is the keyframe's frame. `shots` (N,) is how often each cell of the grid
        fires; by default each of `cells` fires once.
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
        """Return the scan with the ego's motion compensated, if the sensor does that. Points then
        lie as if the car had stood still in the keyframe's frame `sensor`.
        """
        if not self._compensates or scan.times is None:
            return scan
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, 0.0)
        points = self._grid.points(scan.cells, ranges)
        return replace(scan, points=self._motion().compensated(points, sensor, scan.times))

    def _cast_at_once(self, sensor: Frame, cells: Cells, shots: Integers | None) -> Echoes:
        """Return the noticed echoes of cells that fire together from this frame. `Echoes.beams` are
        places in `cells`.
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
        """Return ranges (n,), intensities (n,) and bodies (n,) of one ray per cell."""
        ranges, bodies = engine.cast(sensor, cells)
        rays = sensor.vectors_to_world(grid.directions[cells])
        origins = sensor.origin + sensor.vectors_to_world(grid.origins_of(cells))
        bright = brightness(self._world.primitives, origins, rays, ranges, bodies)
        return ranges, self._signal.intensities(bright, ranges), bodies

    def _scan(self, cells: Cells, echoes: Echoes) -> tuple[Scan, Integers]:
        """Return the echoes as a scan, with an empty row for each cell without an echo."""
        silent = np.setdiff1d(np.arange(len(cells)), echoes.beams)
        count = len(silent)
        nothing = Echoes(silent, np.full(count, np.inf), np.zeros(count), np.full(count, NO_BODY))
        rows = Echoes.joined([echoes, nothing])
        rows = rows.take(np.argsort(rows.beams, kind="stable"))
        fired = cells[rows.beams]
        times = None if self._sweep is None else self._sweep.seconds(fired)
        return Scan(fired, rows.ranges, rows.intensities, times), rows.bodies
