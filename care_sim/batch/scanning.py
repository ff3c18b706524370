"""Firing, scans and the paper's proxy of all worlds.

Cells are chosen as `care_sim.core.firing.base` does, each world with its own shared floor.
The rays are those of the engine `fast` (`care_sim.sensors.engines.ray_kernels`), and the proxy is
that of `care_sim.perception.proxy`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.batch.state import BatchState, Bodies, Fired, Reported, Sensors, Solids
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import lay_ranges
from care_sim.core.cells.boxes import GridSpacing
from care_sim.core.conditions import Conditions
from care_sim.core.firing.base import choose_demanded, list_chosen, top_up
from care_sim.core.firing.floor import (
    FloorCells,
    WordStreams,
    draw_floor,
    floor_cells,
    floor_seed,
    seed_stream,
    word_streams,
)
from care_sim.core.rig import Rig
from care_sim.perception.proxy import count_hits
from care_sim.sensors.engines.ray_kernels import Fan, cast_into
from care_sim.sensors.engines.window_kernels import Parts


class Choice:
    """The free cells of W worlds and their floors, each with its own of the `budgets` (W,), with
    the grid of a `rig` and the `conditions` of the floor.
    """

    def __init__(self, rig: Rig, conditions: Conditions, budgets: Integers):
        worlds, most = len(budgets), int(budgets.max())
        self._budgets = budgets
        self._conditions = conditions
        self._size = rig.grid.size
        self._streams = word_streams(worlds)
        self._drawn = np.full(worlds, -1)
        self._floor = floor_cells(rig.grid.size)
        # A row has room for one cell more, which `list_chosen` may write over and over.
        self._fired = Fired(np.zeros(worlds, np.int64), np.zeros((worlds, most + 1), int))

    def begin(self, world: int, floor: np.random.SeedSequence) -> None:
        """Begin the episode of a world with the seed of its floors."""
        seed_stream(self._streams, world, floor_seed(floor, self._conditions.floor_seed))
        self._drawn[world] = -1

    def fired(self, scores: NDArray[np.float32], live: Mask, keyframes: Integers) -> Fired:
        """The cells that fire by `scores` (W, E, A), finite numbers, in the worlds that are `live`
        (W,), at their `keyframes` (W,), each later than the last one asked for; none in the others.

        The tables are the same at every call, and hold its cells till the next.
        """
        flat = scores.reshape(len(scores), self._size)
        floor = self._conditions.floor, self._streams, self._drawn, self._floor
        _fire(flat, live, keyframes, self._budgets, *floor, self._fired)
        return self._fired


@compiled()
def _fire(
    scores: NDArray[np.float32],
    live: Mask,
    keyframes: Integers,
    budgets: Integers,
    has_floor: bool,
    streams: WordStreams,
    drawn: Integers,
    floor: FloorCells,
    fired: Fired,
) -> None:
    """Fill `fired`; see `Choice.fired`. `drawn` (W,) is the keyframe of the last floor that was
    drawn in each world, `floor` (N,) room for one.
    """
    chosen = np.empty(scores.shape[1], np.bool_)
    for world in range(len(scores)):
        count, budget = 0, budgets[world]
        if live[world]:
            count = choose_demanded(scores[world], budget, chosen)
            if has_floor and count < budget:
                # Unspent ones are drawn as well: no action moves the later ones.
                for _ in range(drawn[world], keyframes[world]):
                    draw_floor(streams, world, floor)
                drawn[world] = keyframes[world]
                count = top_up(chosen, count, floor, budget)
            list_chosen(chosen, fired.cells[world])
        fired.counts[world] = count


ROAD = 0
"""The body id of the road, on which every world stands: it is the first that a world adds."""


class Returns(NamedTuple):
    """What the fired cells of a keyframe met: `counts` (W,) as they were fired; `ranges` (W, F) in
    metres, inf without a return; `ids` (W, F) of bodies, NO_BODY there.
    """

    counts: Integers
    ranges: Floats
    ids: Integers


class Found(NamedTuple):
    """The reported bodies that are detected: `counts` (W,), and in `rows` (W, R) their places in
    `care_sim.batch.state.Reported.bodies`, ascending.
    """

    counts: Integers
    rows: Integers


class Scanning:
    """The LiDARs of all worlds: one level grid, whose rays end at what they meet.

    What it returns it fills anew at the next keyframe.
    """

    def __init__(self, rig: Rig, conditions: Conditions):
        (head,) = rig.grid.heads
        grid = head.grid
        self._reach = float(grid.range_m)
        self._fan = Fan(*grid.fan)
        self._spacing = grid.spacing
        self._least = conditions.min_returns
        self._returns = Returns(_none(0), np.empty((0, 0)), np.empty((0, 0), np.int64))
        self._found = Found(_none(0), np.empty((0, 0), np.int64))

    def scan(self, state: BatchState, fired: Fired) -> Returns:
        """What the `fired` cells meet, the sensors where `state.sensors` has them."""
        if self._returns.ranges.shape != fired.cells.shape:
            shape = fired.cells.shape
            self._returns = Returns(_none(0), np.empty(shape), np.empty(shape, np.int64))
        returns = self._returns._replace(counts=fired.counts)
        _scan(
            state.live,
            fired,
            state.sensors,
            state.solids,
            state.bodies,
            self._fan,
            self._spacing,
            self._reach,
            returns,
        )
        return returns

    def image(self, fired: Fired, returns: Returns, out: NDArray[np.float32], live: Mask) -> None:
        """Write the range images of the worlds that are `live` (W,) into `out` (W, E, A): metres,
        the reach where nothing returned, 0 of cells that were not fired.
        """
        _lay_images(live, fired, returns.ranges, self._reach, out.reshape(len(out), -1))

    def found(self, state: BatchState, returns: Returns) -> Found:
        """The reported bodies that enough fired rays hit."""
        shape = state.reported.bodies.shape
        if self._found.rows.shape != shape:
            self._found = Found(_none(shape[0]), np.empty(shape, np.int64))
        _find(state.live, returns, state.reported, self._least, self._found)
        return self._found


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
    returns: Returns,
) -> None:
    """See `Scanning.scan`."""
    for w in range(len(live)):
        if live[w]:
            rays = fired.counts[w]
            count = solids.counts[w]
            parts = Parts(
                solids.shapes[w, :count],
                solids.halves[w, :count],
                solids.offsets[w, :count],
                solids.owners[w, :count],
            )
            cast_into(
                (returns.ranges[w, :rays], returns.ids[w, :rays]),
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
    live: Mask, fired: Fired, ranges: Floats, reach: float, images: NDArray[np.float32]
) -> None:
    """See `Scanning.image`."""
    for w in range(len(live)):
        if live[w]:
            rays = fired.counts[w]
            lay_ranges(images[w], fired.cells[w, :rays], ranges[w, :rays], reach)


@compiled(brief=True)
def _find(live: Mask, returns: Returns, reported: Reported, least: int, found: Found) -> None:
    """See `Scanning.found`."""
    for w in range(len(live)):
        if live[w]:
            bodies = reported.bodies[w, : reported.counts[w]]
            hits = returns.ids[w, : returns.counts[w]]
            counts = count_hits(bodies, hits)
            found.counts[w] = 0
            for row in range(len(bodies)):
                if counts[row] >= least:
                    found.rows[w, found.counts[w]] = row
                    found.counts[w] += 1


def _none(worlds: int) -> Integers:
    return np.zeros(worlds, np.int64)
