"""The scans of all worlds.

The rays are those of the engine `fast` (`care_sim.sensors.engines.ray_kernels`). A LiDAR with
faults, beams, weather, a tilt, several heads or another engine fires world by world
(`care_sim.sensors.lidar`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, filled, places
from care_sim.core.belief import lay_ranges
from care_sim.core.cells.boxes import GridSpacing
from care_sim.core.conditions import Sensing
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Scan
from care_sim.loops.stages.state import Bodies, Fired, Sensors, Solids, State
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import make_engine
from care_sim.sensors.engines.ray_kernels import Fan, cast_into
from care_sim.sensors.engines.window_kernels import Parts
from care_sim.sensors.lidar import Lidar
from care_sim.world.bullet import NO_BODY
from care_sim.world.world import World

ROAD = 0
"""The body id of the road, on which every world stands: it is the first that a world adds."""


class Returns(NamedTuple):
    """Returns of the fired cells of a keyframe: `counts` (W,) rows, of ascending `cells` (W, F); a
    cell with several returns has a row for each. `ranges` (W, F) in metres, inf without a return;
    `ids` (W, F) of bodies, NO_BODY there.
    """

    counts: Integers
    cells: Integers
    ranges: Floats
    ids: Integers


def lidar_of(world: World, rig: Rig, sensing: Sensing, seed: np.random.SeedSequence) -> Lidar:
    """The LiDAR of a rig in a world; faults are drawn from the `seed`."""
    engine = make_engine(sensing.engine, world.bullet, rig.grid)
    motion = world.linear_motion
    beams = (
        Beams(world.bullet, rig.grid, sensing, sensing.engine, motion)
        if sensing.shapes_beams
        else None
    )
    return Lidar(rig.grid, engine, sensing, seed, beams)


class Scanning:
    """The LiDARs of `worlds` worlds, which `threads` share. Returned arrays are reused at the next
    keyframe.
    """

    scans: dict[int, Scan]
    """By world, all that a LiDAR that fires alone measured at the last keyframe."""

    def __init__(self, rig: Rig, sensing: Sensing, worlds: int, threads: Threads):
        grid = rig.grid
        self._threads = threads
        self._rig = rig
        self._sensing = sensing
        self._reach = float(grid.range_m)
        self.is_compiled = (
            isinstance(grid, AngularGrid)
            and not grid.is_tilted
            and sensing.engine == "fast"
            and not (sensing.shapes_beams or sensing.lidar_range_sigma or sensing.lidar_dropout)
            and not (sensing.lidar_dead_rows or sensing.lidar_crosstalk)
            and rig.hardware.most_shots == 1
        )
        """Whether all worlds are scanned at once."""
        if isinstance(grid, AngularGrid):
            self._fan = Fan(*grid.fan)
            self._spacing = grid.spacing
        self._lidars: dict[int, Lidar] = {}
        self.scans = {}
        none = np.zeros(worlds, np.int64)
        empty = np.empty((worlds, 0), np.int64)
        self._returns = Returns(none, empty, np.empty((worlds, 0)), empty)

    def begin(self, world: int, built: World, seed: np.random.SeedSequence) -> None:
        """Begin an episode; `seed` is that of the LiDAR (`care_sim.loops.episode.SensorSeeds`)."""
        if not self.is_compiled:
            self._lidars[world] = lidar_of(built, self._rig, self._sensing, seed)

    def scan(self, state: State, fired: Fired) -> Returns:
        """Cast the `fired` cells of the live worlds, from `state.sensors`."""
        if not self.is_compiled:
            return self._one_by_one(state, fired)
        if self._returns.ranges.shape != fired.cells.shape:
            shape = fired.cells.shape
            self._returns = Returns(*fired, np.empty(shape), np.empty(shape, np.int64))
        returns = self._returns._replace(counts=fired.counts, cells=fired.cells)
        self._cast(state, state.live, fired, returns.ranges, returns.ids)
        return returns

    def _cast(self, state: State, live: Mask, fired: Fired, ranges: Floats, ids: Integers) -> None:
        """Fill `ranges` and `ids` (W, F) with what cells meet in the worlds that are `live`."""
        tables = state.sensors, state.solids, state.bodies
        given = fired, *tables, self._fan, self._spacing, self._reach, ranges, ids
        self._threads.share(_scan, live, *given)

    def _one_by_one(self, state: State, fired: Fired) -> Returns:
        found: dict[int, Integers] = {}
        self._threads.share(self._fire, state.live, state, fired, found)
        counts, cells, ranges, ids = self._returns
        for world in places(state.live):
            scan, bodies = self.scans[world], found[world]
            counts[world] = len(bodies)
            cells = filled(cells, world, scan.cells)
            ranges = filled(ranges, world, scan.ranges)
            ids = filled(ids, world, bodies)
        self._returns = Returns(counts, cells, ranges, ids)
        return self._returns

    def _fire(self, live: Mask, state: State, fired: Fired, found: dict[int, Integers]) -> None:
        """Scan the worlds that are `live` (W,), and put the bodies of their returns into `found`,
        by world.
        """
        for world in places(live):
            given = fired.cells[world, : fired.counts[world]], state.sensors.frame(world)
            self.scans[world], found[world] = self._lidars[world].fire(*given)

    def lidar(self, world: int) -> Lidar | None:
        """The LiDAR of a world that fires alone, else None."""
        return self._lidars.get(world)

    def hits(self, state: State, live: Mask, bodies: Integers, asked: Fired) -> Integers:
        """(W,) how many of the cells `asked`, each fired once, would hit one of the `bodies` (W,)
        in the worlds that are `live`; see `care_sim.sensors.lidar.Lidar.hits`.
        """
        found = np.zeros(state.worlds, np.int64)
        if not self.is_compiled:
            for world in places(live & (asked.counts > 0)):
                cells = asked.cells[world, : asked.counts[world]]
                given = int(bodies[world]), cells, state.sensors.frame(world)
                found[world] = self._lidars[world].hits(*given)
            return found
        ids = np.full(asked.cells.shape, NO_BODY)
        self._cast(state, live, asked, np.empty(ids.shape), ids)
        in_use = np.arange(asked.cells.shape[1]) < asked.counts[:, None]
        hit = (ids == bodies[:, None]) & in_use & live[:, None]
        counts: Integers = hit.sum(axis=1)
        return counts

    def image(self, returns: Returns, out: NDArray[np.float32], live: Mask) -> None:
        """Write the range images of the worlds that are `live` (W,) into `out` (W, E, A): metres,
        the reach where nothing returned, 0 of cells that were not fired.
        """
        counts, cells, ranges, _ = returns
        given = counts, cells, ranges, self._reach, out.reshape(len(out), -1)
        self._threads.share(_lay_images, live, *given)


@compiled()
def _scan(
    live: Mask,
    fired: Fired,
    sensors: Sensors,
    solids: Solids,
    bodies: Bodies,
    fan: Fan,
    spacing: GridSpacing,
    reach: float,
    ranges: Floats,
    ids: Integers,
) -> None:
    """See `Scanning.scan`."""
    for w in range(len(live)):
        if live[w]:
            rays = fired.counts[w]
            count = solids.counts[w]
            shapes, halves, offsets, owners = solids.parts
            parts = Parts(
                shapes[w, :count], halves[w, :count], offsets[w, :count], owners[w, :count]
            )
            cast_into(
                (ranges[w, :rays], ids[w, :rays]),
                fired.cells[w, :rays],
                reach,
                fan,
                spacing,
                sensors.poses[w],
                parts,
                bodies.poses[w],
                ROAD,
            )


@compiled()
def _lay_images(
    live: Mask,
    counts: Integers,
    cells: Integers,
    ranges: Floats,
    reach: float,
    images: NDArray[np.float32],
) -> None:
    """See `Scanning.image`."""
    for w in range(len(live)):
        if live[w]:
            rays = counts[w]
            lay_ranges(images[w], cells[w, :rays], ranges[w, :rays], reach)
