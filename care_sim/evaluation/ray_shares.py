"""Which share of the budget fired the rays that hit an object at a keyframe.

The shares are those of Algorithm 1: exploitation, the reserve layers in their order, the floor. A
cell belongs to the share that took it, though later ones may have asked for it too.
"""

from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from care_sim.core.allocation import stages_of, taken_by_stage
from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand

RAY_SHARES = ("exploitation", "layer_1", "layer_2", "later_layers", "floor")
"""The shares that are told apart. Of CARE layer 1 is U, of care-sbf layers 1 and 2 are U and M; a
policy with a layer for every shell of distance has dozens, of which the later ones are one."""
_LAST_OWN, _LATER, _FLOOR = 2, 3, 4
"""Places in RAY_SHARES: up to the first, a stage has a share of its own."""


@dataclass(frozen=True)
class ServedDemand:
    """What a policy asked for at a keyframe and what it got: all cells `fired` (n,), and those that
    fired for every stage of the demand (`took`), exploitation first. The others are the floor's.
    """

    demand: Demand
    fired: Cells
    took: tuple[Cells, ...]

    @classmethod
    def of(cls, demand: Demand, fired: Cells, rig: Rig) -> "ServedDemand":
        """Of a demand whose allocation, and floor, are the cells `fired`. A cell that fires along
        with others of its unit belongs to the stage of the first of them that was asked for.
        """
        stages = taken_by_stage(demand, rig.budget, rig.reserve_fraction)
        places = rig.hardware.credited(np.concatenate(stages), fired)
        ends = np.cumsum([0, *map(len, stages)])
        return cls(
            demand,
            fired,
            tuple(
                fired[(start <= places) & (places < end)] for start, end in pairwise(ends.tolist())
            ),
        )

    @property
    def sets(self) -> list[Cells]:
        """All sets that were asked for, in order of stage and set."""
        return [*chain(*stages_of(self.demand))]


def rays_by_share(returns: Cells, served: ServedDemand) -> Integers:
    """(5,) how many rays of each of `RAY_SHARES` hit an object.

    `returns` (P,) are the cells of all returns that a full scan has on it: a cell with two returns
    counts twice, for it gives the detector two.
    """
    counts = np.zeros(len(RAY_SHARES), np.int64)
    for stage, cells in enumerate(served.took):
        counts[stage if stage <= _LAST_OWN else _LATER] += _hits(returns, cells)
    counts[_FLOOR] = _hits(returns, served.fired) - counts.sum()
    return counts


def shares_of_credit(rays: Integers) -> Floats:
    """(e, 5) the part that each share has in every one of e sightings, by the rays (e, 5) that hit
    it: every sighting counts 1, and one that no ray hit counts nothing.
    """
    totals = rays.sum(axis=1, keepdims=True)
    parts: Floats = np.divide(rays, totals, out=np.zeros(rays.shape), where=totals > 0)
    return parts


def _hits(returns: Cells, cells: Cells) -> int:
    return int(np.isin(returns, cells).sum())
