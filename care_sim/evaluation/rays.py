"""Where the rays of a keyframe went (paper, Sec. 5.2): which share of the budget hit an object, how
the camera's wedges meet the reserve, and why an object was missed.

Why a policy did not detect an object at its first keyframe, for every miss exactly one reason.

Two questions decide. Did the policy ask for enough of the cells in which a full scan finds the
object? Where it did, the budget ended first, or the rays came back with too little. Where it did
not: what had the camera shown of the object?

Too few of its cells were asked for:

- `not in picture`: no image box of it had reached the policy. It was outside the pictures, the
  detector missed it, or it was too small or too late.
- `explained`: it had image boxes, but forecasts explain them all, and no wedge of them was asked
  for.
- `not demanded`: an image box of it is unexplained, and its wedge was not asked for. The policy has
  no camera, or takes another part of it.

Enough of them were asked for, and the budget ended before enough were fired. What decides is the
set that owes most of them:

- `starved`: it got fewer cells than a detection needs.
- `elsewhere`: it got as many or more, but not these: for example the margin by which it is dilated,
  or the first part of a pattern.

Nothing more could be asked for:

- `too few returns`: rays enough hit it; or the wedge of an image box was asked for and lies beside
  it; or a full scan has too few returns on it.

Of a policy that never asks the camera, the first three reasons tell what the camera would have
shown it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from care_sim.core.allocation import half_up, stages_of, taken_by_stage
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.evaluation.differences import Adding

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


@dataclass(frozen=True)
class ReserveUse(Adding):
    """How the camera's wedges meet the reserve (paper, Sec. 5.2, "The near-tie is mechanical"), as
    sums over keyframes.

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
        filled_rho=int(len(taken) >= budget - half_up((1 - reserve_fraction) * budget)),
        explained_cells=len(removed),
        untaken_cells=len(np.setdiff1d(removed, exploited)),
    )


def _union(sets: Sequence[Cells]) -> Cells:
    return np.unique(np.concatenate([*sets, np.empty(0, np.int64)]))


MISS_REASONS = (
    "not in picture",
    "explained",
    "not demanded",
    "starved",
    "elsewhere",
    "too few returns",
)
NOT_IN_PICTURE, EXPLAINED, NOT_DEMANDED, STARVED, ELSEWHERE, TOO_FEW_RETURNS = MISS_REASONS


@dataclass(frozen=True)
class Appearance:
    """An object at its first keyframe. Truth: for the scoring alone.

    `returns` (P,) are the cells of the returns that a full scan has on it, `wedges` those of the b
    image boxes of it that reached the policy, `explained` (b,) whether a forecast explains each.
    `tracked` says whether a track is on it already: it was detected beyond the scored range.
    """

    returns: Cells
    wedges: tuple[Cells, ...]
    explained: Mask
    tracked: bool = False

    @property
    def falsely_explained(self) -> bool:
        """Whether forecasts of other objects alone explain it: it has an image box, all of them are
        explained, and no track is on it.
        """
        return bool(self.wedges) and bool(self.explained.all()) and not self.tracked


def miss_reason(seen: Appearance, served: ServedDemand, min_returns: int) -> str:
    """One of `MISS_REASONS` for an object that was not detected; a detection needs `min_returns`
    returns, at least.
    """
    hit = np.isin(seen.returns, served.fired)
    if hit.sum() >= min_returns or len(seen.returns) < min_returns:
        return TOO_FEW_RETURNS
    asked = np.unique(np.concatenate([*served.sets, np.empty(0, np.int64)]))
    if np.isin(seen.returns, asked).sum() >= min_returns:
        return _of_budget(seen.returns[~hit], served, min_returns)
    if not seen.wedges:
        return NOT_IN_PICTURE
    # A wedge that was asked for lies beside the object: its cells would be among those asked for.
    if any(np.isin(wedge, asked).all() for wedge in seen.wedges):
        return TOO_FEW_RETURNS
    return EXPLAINED if seen.explained.all() else NOT_DEMANDED


def _of_budget(owed: Cells, served: ServedDemand, min_returns: int) -> str:
    """Which of the two where the budget ended before cells `owed` (n,) were fired."""
    # Every set that still owes a cell was cut off. The one that owes most of them, the first of
    # equals, is the one that would have found the object.
    debts = [int(np.isin(owed, cells).sum()) for cells in served.sets]
    debtor = served.sets[int(np.argmax(debts))]
    return STARVED if np.isin(debtor, served.fired).sum() < min_returns else ELSEWHERE
