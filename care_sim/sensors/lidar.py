"""LiDARs that fire only chosen cells: a simulated one, and one whose full scan was recorded. Faults
of both: noise, lost returns, dead rows, crosstalk.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import LidarFaults, ReturnSettings, Sensing
from care_sim.core.firing.base import shots_by_cell
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.types import Scan
from care_sim.sensors.annotated import NO_OBJECT, Cloud, joined, rings_of
from care_sim.sensors.beams import Beams, RollingSweep
from care_sim.sensors.engines import Engine
from care_sim.world.bullet import NO_BODY

NEAREST_M = 0.01
"""A noisy return stays this far from 0 m (not fired) and from the reach (no return)."""


class CellFaults:
    """The faults of the cells of one LiDAR; `dead` (N,) are those of its dead rows.

    Noise and dropout are drawn once per cell, fired or not, so that every policy meets the same
    (common random numbers). Raises InvalidInput for a dead row that the grid does not have.
    """

    def __init__(self, grid: Grid, faults: LidarFaults, seed: np.random.SeedSequence):
        check_dead_rows(grid, faults.lidar_dead_rows)
        self.dead: Mask = np.isin(np.arange(grid.size) // grid.columns, faults.lidar_dead_rows)
        self.is_noisy = faults.lidar_range_sigma > 0
        self._grid = grid
        self._faults = faults
        self._noise = np.random.default_rng(seed)
        dropout = seed.spawn(1)[0]
        self._dropout = np.random.default_rng(dropout)
        # A stream of its own: a recording draws the same for the others, with far returns or not.
        self._far_noise = np.random.default_rng(dropout.spawn(1)[0])

    def draw_noisy(self, ranges: Floats, cells: Cells, shots: Integers | None = None) -> Floats:
        """(n,) the `ranges` (n,) of `cells` (n,) as they are measured at this keyframe, metres.

        `shots` (N,) says how often every cell fires, once unless given: the mean over n shots errs
        by the root of n less.
        """
        errors = self._errors(self._noise, cells, shots)
        # No return stays no return: noise is that of a measured range.
        (hit,) = np.isfinite(ranges).nonzero()
        measured = ranges.copy()
        measured[hit] = noisy(ranges[hit], errors[hit], self._grid.reach_of(cells[hit]))
        return measured

    def draw_noisy_far(self, ranges: Floats, cells: Cells, shots: Integers | None = None) -> Floats:
        """`draw_noisy` of returns from beyond the reach, which stay there: noise is folded back at
        it.
        """
        reach = self._grid.reach_of(cells)
        return reach + np.abs(ranges + self._errors(self._far_noise, cells, shots) - reach)

    def _errors(self, stream: np.random.Generator, cells: Cells, shots: Integers | None) -> Floats:
        """(n,) metres."""
        sigma = self._faults.lidar_range_sigma
        errors: Floats = sigma * stream.standard_normal(self._grid.size)[cells]
        return errors if shots is None else errors / np.sqrt(shots[cells])

    def draw_lost(self, cells: Cells) -> Mask:
        """(n,) which of `cells` (n,) return nothing at this keyframe, dead or dropped."""
        lost = self.dead[cells]
        rate = self._faults.lidar_dropout
        if rate > 0:
            lost = lost | (self._dropout.random(self._grid.size)[cells] < rate)
        return lost


def noisy(ranges: Floats, errors: Floats, reach: float | Floats) -> Floats:
    """(n,) `ranges` with `errors`, metres; the `reach` is that of all, or (n,) of each.

    Ranges that would come within NEAREST_M of 0 or of the reach, or beyond, are folded back. If it
    were cut instead, ranges would heap up at one number, which would tell a policy that they were
    cut.
    """
    erring = ranges + errors
    span = reach - 2 * NEAREST_M
    # A triangle wave: the way from the near bound to the far one and back is 2 * span long.
    beyond = np.mod(erring - NEAREST_M, 2 * span)
    folded: Floats = NEAREST_M + np.minimum(beyond, 2 * span - beyond)
    # Ranges between the bounds stay as they are to the last bit; folding would round them.
    return np.where(np.abs(erring - reach / 2) <= span / 2, erring, folded)


def check_dead_rows(grid: Grid, rows: Sequence[int]) -> None:
    """Raise InvalidInput for a row that the grid does not have."""
    for row in rows:
        if row >= grid.rows:
            raise InvalidInput(f"lidar_dead_rows must lie in 0..{grid.rows - 1}, got {row}")


FULL_INTENSITY = 1.0
"""Intensity of a foreign pulse."""


class Crosstalk:
    """The ghosts of a LiDAR: a share `lidar_crosstalk` of its cells has one at each keyframe.

    A ghost is a pulse of another LiDAR that a cell takes for the return of its own. Sensors in view
    of each other do meet this way (Kim et al. 2015, Proc. SPIE 9504). The other one is not in step,
    so its pulse arrives at any time while the cell listens: the range that it feigns is anywhere
    within reach. It came one way and straight, so that it is taken for the strongest.

    Ghosts are drawn once per cell, fired or not, so that every policy meets the same (common random
    numbers).
    """

    def __init__(self, grid: Grid, settings: ReturnSettings, seed: np.random.SeedSequence):
        self._grid = grid
        self._rate = settings.lidar_crosstalk
        # The same at every keyframe, and as large as the grid.
        self._spans_m = grid.reach_of(np.arange(grid.size)) - 2 * NEAREST_M
        self._sweep = RollingSweep(grid, settings.lidar_sweep_s)
        self._random = np.random.default_rng(seed)

    def add_to_scan(self, scan: Scan, bodies: Integers) -> tuple[Scan, Integers]:
        """A scan, and the bodies (n,) behind its returns, with the ghosts of this keyframe."""
        ghosts, ranges = self._draw()
        jammed = ghosts[scan.cells]
        strengths = scan.intensities
        if strengths is not None:
            strengths = np.where(jammed, FULL_INTENSITY, strengths)
        feigned = np.where(jammed, ranges[scan.cells], scan.ranges)
        haunted = replace(scan, ranges=feigned, intensities=strengths)
        # A ghost is one return, also where there were two.
        twice = jammed & (np.diff(scan.cells, prepend=-1) == 0)
        return haunted.take(~twice), np.where(jammed, NO_BODY, bodies)[~twice]

    def add_to_cloud(self, cloud: Cloud, answering: Mask) -> Cloud:
        """A cloud with the ghosts of this keyframe in those cells that are `answering` (N,)."""
        ghosts, ranges = self._draw()
        cells = np.flatnonzero(ghosts & answering)
        feigned = Cloud(
            cells,
            self._grid.points(cells, ranges[cells]),
            np.full(len(cells), NO_OBJECT),
            None if cloud.intensities is None else np.full(len(cells), FULL_INTENSITY),
            None if cloud.times is None else self._sweep.seconds(cells),
            rings=None if cloud.rings is None else rings_of(cells, self._grid),
        )
        return joined([cloud.of_cells(~ghosts), feigned])

    def _draw(self) -> tuple[Mask, Floats]:
        """(N,) which cells have a ghost at this keyframe, and (N,) how far off it seems."""
        ghosts = self._random.random(self._grid.size) < self._rate
        return ghosts, NEAREST_M + self._spans_m * self._random.random(self._grid.size)


def crosstalk_of(
    grid: Grid, settings: ReturnSettings, seed: np.random.SeedSequence
) -> Crosstalk | None:
    """The crosstalk of a LiDAR with this `seed`, if there is any. It has a stream of its own: noise
    and dropout are drawn as without it.
    """
    return Crosstalk(grid, settings, seed.spawn(1)[0]) if settings.lidar_crosstalk else None


class Lidar:
    """Casts the fired cells through an engine, or as `beams` where pulses have more to them than a
    ray; `CellFaults` and `Crosstalk` are applied to what comes back.
    """

    def __init__(
        self,
        grid: Grid,
        engine: Engine,
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
        """Return the scan of every cell, fired once each, without noise, crosstalk and dropout.
        Draws no random numbers.
        """
        scan, _ = self._cast(np.arange(self.grid.size), sensor)
        if len(scan.cells) > self.grid.size:
            # A cell with two returns keeps the nearer one, which comes first.
            scan = scan.take(np.diff(scan.cells, prepend=-1) > 0)
        return _without(scan, self._faults.dead)

    def bodies(self, sensor: Frame) -> Integers:
        """Return (N,) the body that every cell, fired once, would hit, NO_BODY for none. Draws no
        random numbers.
        """
        scan, bodies = self._cast(np.arange(self.grid.size), sensor)
        found = np.full(self.grid.size, NO_BODY)
        # Backwards, so that of a cell with two returns the nearer one, which comes first, stays.
        found[scan.cells[::-1]] = bodies[::-1]
        found[self._faults.dead] = NO_BODY
        return found

    def hits(self, body: int, cells: Cells, sensor: Frame) -> int:
        """Count the `cells` that would hit a body, fired once each, without noise, crosstalk and
        dropout. Draws no random numbers.
        """
        scan, bodies = self._cast(cells, sensor)
        return int(np.count_nonzero((bodies == body) & ~self._faults.dead[scan.cells]))

    def fire(self, fired: Cells, sensor: Frame) -> tuple[Scan, Integers]:
        """Fire the ascending cells `fired` from the frame `sensor`. A repeated cell is fired as
        often and answers once, since its receiver adds up the pulses. Returns the scan, and the
        body id behind every return, for the proxy detector only.
        """
        cells, shots = shots_by_cell(fired, self.grid.size)
        scan, ids = self._cast(cells, sensor, shots)
        if self._faults.is_noisy:
            measured = self._faults.draw_noisy(scan.ranges, scan.cells, shots)
            scan = replace(scan, ranges=measured)
        if self._crosstalk is not None:
            scan, ids = self._crosstalk.add_to_scan(scan, ids)
        lost = self._faults.draw_lost(scan.cells)
        scan = _without(scan, lost)
        if self._beams is not None:
            scan = self._beams.compensated(scan, sensor)
        return scan, np.where(lost, NO_BODY, ids)

    def _cast(
        self, cells: Cells, sensor: Frame, shots: Integers | None = None
    ) -> tuple[Scan, Integers]:
        """Return the cells' returns and the bodies behind them; `shots` as in `Beams.cast`."""
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
    """A LiDAR whose full scan was recorded. Fired cells return their part of it, after `CellFaults`
    and `Crosstalk`.
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
            returned = self._moved(returned, self._faults.draw_noisy, shots)
            if returned.far is not None:
                far = self._moved(returned.far, self._faults.draw_noisy_far, shots)
                returned = replace(returned, far=far)
        return self._crosstalk.add_to_cloud(returned, answering) if self._crosstalk else returned

    def peek(self, cloud: Cloud) -> Cloud:
        """Return the returns of every cell, fired once each, without noise and dropout. Draws no
        random numbers.
        """
        return cloud.of_cells(~self._faults.dead).to_shots()

    def ranges(self, cloud: Cloud) -> Floats:
        """(N,) the nearest return of every cell in metres, inf without one."""
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        nearest: Floats = _nearest(self.grid.size, cloud.cells, ranges)
        return nearest

    def _moved(
        self,
        cloud: Cloud,
        draw: Callable[[Floats, Cells, Integers | None], Floats],
        shots: Integers | None,
    ) -> Cloud:
        """The returns at the ranges that `draw` makes of theirs."""
        # Noise is along the ray: a point moves with its range, and stays in its cell.
        ranges = self.grid.ranges_to(cloud.cells, cloud.points)
        moved = draw(ranges, cloud.cells, shots) / ranges
        return replace(cloud, points=self.grid.stretched(cloud.cells, cloud.points, moved))


@compiled()
def _nearest(size: int, cells: Cells, ranges: Floats) -> Floats:
    """Return (N,) the least of the `ranges` (n,) of each of `size` cells, inf without one."""
    nearest = np.full(size, np.inf)
    for n in range(len(cells)):
        nearest[cells[n]] = min(nearest[cells[n]], ranges[n])
    return nearest
