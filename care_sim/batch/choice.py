"""The cells that the actions of all worlds fire, as `care_sim.core.firing.base` chooses them,
each world with its own shared floor.
"""

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.batch.state import Fired
from care_sim.core.arrays import Integers, Mask
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
                # Those that nobody spent are drawn as well: no action moves the later ones.
                for _ in range(drawn[world], keyframes[world]):
                    draw_floor(streams, world, floor)
                drawn[world] = keyframes[world]
                count = top_up(chosen, count, floor, budget)
            list_chosen(chosen, fired.cells[world])
        fired.counts[world] = count
