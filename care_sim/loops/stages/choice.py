"""The cells that fire in all worlds, each with its own floor.

Free cells are chosen as `care_sim.core.firing.base` does, in compiled code; those of other hardware
world by world.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.base.threads import ALONE, Threads
from care_sim.core.arrays import Integers, Mask
from care_sim.core.belief import lie_between
from care_sim.core.conditions import Conditions
from care_sim.core.defaults import CELLS
from care_sim.core.firing.base import fire_free
from care_sim.core.firing.floor import Floor, floor_key
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.loops.stages.state import Fired

_NOTHING = np.empty(0, np.int64)
_LARGEST = float(np.finfo(np.float32).max)


class Choice:
    """Chooses the cells that the LiDARs of W worlds fire. The `rigs` of the worlds differ at most
    in budget and camera. The `conditions` give the floor. The worlds are shared by `threads`.
    """

    def __init__(self, rigs: Sequence[Rig], conditions: Conditions, threads: Threads = ALONE):
        rig, worlds = rigs[0], len(rigs)
        self._budgets = np.array([each.budget for each in rigs])
        most = int(self._budgets.max())
        self._conditions = conditions
        self._threads = threads
        self._rig = rig
        self._is_free = rig.firing == CELLS
        # The keys of the floors.
        self._keys = np.zeros((worlds, 2), np.int64)
        self._cells = np.arange(rig.grid.size)
        # `fire_free` needs room for one cell more.
        self._fired = Fired(np.zeros(worlds, np.int64), np.zeros((worlds, most + 1), int))
        # The last cells of hardware in units, world by world.
        self._last: list[Cells] = [_NOTHING] * worlds

    def begin(self, world: int, floor: np.random.SeedSequence) -> None:
        """Begin the episode of a world with the seed of its floors."""
        self._keys[world] = floor_key(floor, self._conditions.floor_seed)
        self._last[world] = _NOTHING

    def fired(self, scores: NDArray[np.float32], live: Mask, keyframes: Integers) -> Fired:
        """Return the cells that fire by `scores` (W, E, A) in the worlds that are `live` (W,), at
        their `keyframes` (W,); none in the others. Raises InvalidInput for scores of live worlds
        that are not finite.

        The tables of free cells are the same at every call, and hold its cells till the next.
        """
        flat = scores.reshape(len(scores), -1)
        if not self._is_free:
            check_finite(flat[live])
            return Fired.of(self._in_units(scores, live, keyframes))
        self._fired.counts[~live] = 0
        floors = self._conditions.floor, self._keys
        given = flat, keyframes, self._budgets, *floors, self._cells, self._fired
        self._threads.share(_fire, live, *given)
        if self._fired.counts.min() < 0:
            raise _not_finite()
        return self._fired

    def would_fire(self, world: int, scores: NDArray[np.float32], keyframe: int) -> Cells:
        """Return the cells that would fire in a world by `scores` (E, A) at a keyframe. Changes
        nothing.
        """
        first, second = self._keys[world].tolist()
        floor = Floor(first, second, keyframe) if self._conditions.floor else None
        budget = int(self._budgets[world])
        return self._rig.hardware.fire(scores, budget, floor, self._last[world])

    def _in_units(
        self, scores: NDArray[np.float32], live: Mask, keyframes: Integers
    ) -> Sequence[Cells]:
        rows = [_NOTHING] * len(live)
        for world in np.flatnonzero(live).tolist():
            fired = self.would_fire(world, scores[world], int(keyframes[world]))
            rows[world] = self._last[world] = fired
        return rows


def check_finite(scores: NDArray[np.float32]) -> None:
    """Raise InvalidInput for scores that are not finite."""
    if not np.isfinite(scores).all():
        raise _not_finite()


def _not_finite() -> InvalidInput:
    return InvalidInput(
        "action must not hold NaN or infinity (of float32); score a cell 0 to leave it out"
    )


@compiled()
def _fire(
    live: Mask,
    scores: NDArray[np.float32],
    keyframes: Integers,
    budgets: Integers,
    has_floor: bool,
    keys: Integers,
    units: Cells,
    fired: Fired,
) -> None:
    """Fill `fired` of the worlds that are `live`; see `Choice.fired`. The count is -1 where scores
    are not finite.
    """
    chosen = np.empty(scores.shape[1], np.bool_)
    for world in range(len(scores)):
        if live[world]:
            floor = Floor(keys[world, 0], keys[world, 1], keyframes[world])
            given = scores[world], budgets[world], has_floor, floor, units
            # Scores are read here anyway: a pass of its own over those of all worlds takes longer.
            is_finite = lie_between(scores[world : world + 1], -_LARGEST, _LARGEST)
            count = fire_free(*given, chosen, fired.cells[world]) if is_finite else -1
            fired.counts[world] = count
