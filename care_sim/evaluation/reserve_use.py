"""How the camera's wedges meet the reserve at a keyframe (paper, Sec. 5.2, "The near-tie is
mechanical").
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from care_sim.core.allocation import taken_by_stage
from care_sim.core.grid import Cells
from care_sim.core.types import Demand


@dataclass(frozen=True)
class ReserveUse:
    """Sums over keyframes; they add.

    At `filled` of the `keyframes` the unexplained wedges U alone take all that exploitation leaves
    of the budget, so that nothing is left to the explained wedges M or to the floor; at
    `filled_rho` they take the reserve's own rho B at least. `explained_cells` are the cells of M
    outside U, which the residual filter removes, and `untaken_cells` those of them that
    exploitation had not taken.
    """

    keyframes: int = 0
    filled: int = 0
    filled_rho: int = 0
    explained_cells: int = 0
    untaken_cells: int = 0

    def __add__(self, other: "ReserveUse") -> "ReserveUse":
        return ReserveUse(
            *(getattr(self, column.name) + getattr(other, column.name) for column in fields(self))
        )


def reserve_use(
    hulls: Sequence[Cells],
    unexplained: Sequence[Cells],
    by_memory: Sequence[Cells],
    budget: int,
    reserve_fraction: float,
) -> ReserveUse:
    """Of one keyframe: exploitation takes `hulls`, U is `unexplained` and M is `by_memory`."""
    exploited, taken = taken_by_stage(Demand(hulls, [unexplained]), budget, reserve_fraction)
    removed = np.setdiff1d(_union(by_memory), _union(unexplained))
    return ReserveUse(
        keyframes=1,
        filled=int(len(exploited) + len(taken) == budget),
        # What exploitation may take is rounded, and the reserve keeps the rest.
        filled_rho=int(len(taken) >= budget - round((1 - reserve_fraction) * budget)),
        explained_cells=len(removed),
        untaken_cells=len(np.setdiff1d(removed, exploited)),
    )


def _union(sets: Sequence[Cells]) -> Cells:
    return np.unique(np.concatenate([*sets, np.empty(0, np.int64)]))
