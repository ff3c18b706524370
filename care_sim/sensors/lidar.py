"""LiDARs that fire chosen cells, and nothing else: a simulated one, and one whose full scan was
recorded.
"""

from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import Sensing
from care_sim.core.firing.base import shots_by_cell
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.types import Scan
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import RayEngine
from care_sim.sensors.lidar_faults import CellFaults, crosstalk_of
from care_sim.world.bullet import NO_BODY


class Lidar:
    """Casts the fired cells through an engine, or as `beams` where pulses have more to them than a
    ray; `CellFaults` and `Crosstalk` are applied to what comes back.
    """

    def __init__(
        self,
        grid: Grid,
        engine: RayEngine,
        sensing: Sensing,
        seed: np.random.SeedSequence,
        beams: Beams | None = None,
    ):
        self.grid = grid
        self._engine = engine
        self._beams = beams
        self._faults = CellFaults(grid, sensing, seed)
        self._crosstalk = crosstalk_of(grid, sensing, seed)

    def peek(self, sensor: Frame) -> Scan:
        """What a scan of every cell would return, each fired once, before noise, crosstalk and
        dropout, which stay undrawn.
        """
        scan, _ = self._cast(np.arange(self.grid.size), sensor)
        if len(scan.cells) > self.grid.size:
            # Of a cell with two returns the nearer one, which comes first.
            scan = scan.take(np.diff(scan.cells, prepend=-1) > 0)
        return _without(scan, self._faults.dead)

    def bodies(self, sensor: Frame) -> Integers:
        """(N,) the body that every cell, fired once, would hit, NO_BODY for none; as in `peek`
        nothing is drawn.
        """
        scan, bodies = self._cast(np.arange(self.grid.size), sensor)
        found = np.full(self.grid.size, NO_BODY)
        # Backwards, so that of a cell with two returns the nearer one, which comes first, stays.
        found[scan.cells[::-1]] = bodies[::-1]
        found[self._faults.dead] = NO_BODY
        return found

    def hits(self, body: int, cells: Cells, sensor: Frame) -> int:
        """How many of `cells`, each fired once, would hit a body, before noise, crosstalk and
        dropout, which stay undrawn.
        """
        scan, bodies = self._cast(cells, sensor)
        return int(np.count_nonzero((bodies == body) & ~self._faults.dead[scan.cells]))

    def fire(self, fired: Cells, sensor: Frame) -> tuple[Scan, Integers]:
        """Fire the ascending cells `fired` from the frame `sensor`. One that stands there several
        times is fired as often, and answers once: what its receiver counts adds up.

        Returns the scan, and the body id behind every return for the proxy detector alone.
        """
        cells, shots = shots_by_cell(fired, self.grid.size)
        scan, ids = self._cast(cells, sensor, shots)
        if self._faults.is_noisy:
            measured = self._faults.draw_noisy(scan.ranges, scan.cells, shots)
            scan = replace(scan, ranges=measured)
        if self._crosstalk is not None:
            scan, ids = self._crosstalk.over_scan(scan, ids)
        lost = self._faults.draw_lost(scan.cells)
        scan = _without(scan, lost)
        if self._beams is not None:
            scan = self._beams.compensated(scan, sensor)
        return scan, np.where(lost, NO_BODY, ids)

    def _cast(
        self, cells: Cells, sensor: Frame, shots: Integers | None = None
    ) -> tuple[Scan, Integers]:
        """What the cells meet, and the bodies behind it; `shots` as in `Beams.cast`."""
        if self._beams is not None:
            return self._beams.cast(sensor, cells, shots)
        ranges, ids = self._engine.cast(sensor, cells)
        return Scan(cells, ranges), ids


def _without(scan: Scan, lost: Mask) -> Scan:
    """The scan whose `lost` (n,) cells return nothing."""
    ranges = np.where(lost, np.inf, scan.ranges)
    strengths, times = scan.intensities, scan.times
    if strengths is not None:
        strengths = np.where(lost, 0.0, strengths)
    if times is not None:
        times = np.where(np.isfinite(ranges), times, 0.0)
    return Scan(scan.cells, ranges, strengths, times)


class RecordedLidar:
    """A full scan was recorded, and fired cells return their part of it; `CellFaults` and
    `Crosstalk` are applied to them.
    """

    def __init__(self, grid: Grid, sensing: Sensing, seed: np.random.SeedSequence):
        self.grid = grid
        self._faults = CellFaults(grid, sensing, seed)
        self._crosstalk = crosstalk_of(grid, sensing, seed)

    def fire(self, fired: Cells, cloud: Cloud) -> Cloud:
        """The returns of the ascending cells `fired` (k,) in the recorded `cloud`, after the
        faults; a cell that stands there several times was fired as often.
        """
        cells, shots = shots_by_cell(fired, self.grid.size)
        # A cell is dropped with all its returns, of which a recorded sweep may have several.
        answering = np.zeros(self.grid.size, dtype=bool)
        answering[cells] = ~self._faults.draw_lost(cells)
        returned = cloud.of_cells(answering).to_shots(shots)
        if self._faults.is_noisy:
            returned = self._noisy(returned, shots)
        return self._crosstalk.over_cloud(returned, answering) if self._crosstalk else returned

    def peek(self, cloud: Cloud) -> Cloud:
        """What every cell would return, each fired once, before noise and dropout, which stay
        undrawn.
        """
        return cloud.of_cells(~self._faults.dead).to_shots()

    def ranges(self, cloud: Cloud) -> Floats:
        """(N,) the nearest return of every cell in metres, inf without one."""
        nearest = np.full(self.grid.size, np.inf)
        # Cells come ascending, so the returns of each are one stretch.
        cells, starts = np.unique(cloud.cells, return_index=True)
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        nearest[cells] = np.minimum.reduceat(ranges, starts)
        return nearest

    def _noisy(self, cloud: Cloud, shots: Integers | None) -> Cloud:
        # Noise is along the ray: a point moves with its range, and stays in its cell.
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        moved = self._faults.draw_noisy(ranges, cloud.cells, shots) / ranges
        return replace(cloud, points=self.grid.stretched(cloud.cells, cloud.points, moved))
