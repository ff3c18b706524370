"""Which share of the budget every fired cell came from: told by the allocator, never guessed."""

import numpy as np
from numpy.typing import NDArray

from care_sim.core.allocation import allocate
from care_sim.core.grid import Cells
from care_sim.core.types import Action, Demand, Rig

SHARES = ("not fired", "exploitation", "reserve", "floor", "chosen")
NOT_FIRED, EXPLOITATION, RESERVE, FLOOR, CHOSEN = range(len(SHARES))


def shares_of(fired: Cells, action: Action, demand: Demand | None, rig: Rig) -> NDArray[np.uint8]:
    """(E, A) the share of every cell, an index into `SHARES`.

    Exploitation fills first, whatever the layers ask for, so that the allocator without the layers tells where it
    ended. Without the `demand` behind the `action`, or if it is not the one behind it, what the action scored is no
    more than "chosen".
    """
    shares = np.zeros(rig.grid.size, np.uint8)
    shares[fired] = FLOOR
    scored = fired[np.asarray(action).ravel()[fired] > 0]
    shares[scored] = CHOSEN
    if demand is not None:
        taken = allocate(demand, rig.budget, rig.reserve_fraction)
        if np.array_equal(np.sort(taken), scored):
            shares[taken] = RESERVE
            shares[allocate(Demand(demand.exploitation), rig.budget, rig.reserve_fraction)] = EXPLOITATION
    return shares.reshape(rig.grid.shape)
