"""Where the rays of a keyframe went (paper, Sec. 5.2): the share of the budget that hit an object,
the camera's wedges in the reserve, and the reason of each miss.

Each miss of an object at its first keyframe has exactly one reason.

Two questions decide. Did the policy demand enough of the cells in which a full scan detects the
object? If so, the budget ended first, or the rays returned too little. If not: what had the camera
shown of the object?

The policy demanded too few cells of the object:

- `not in picture`: no image box of it had reached the policy. It was outside the pictures, missed
  by the detector, too small or too late.
- `explained`: it had image boxes, but forecasts explain them all, and no wedge of them was
  demanded.
- `not demanded`: an image box of it is unexplained, and its wedge was not demanded. The policy has
  no camera, or takes another part of it.

The policy demanded enough cells, and the budget ended before enough were fired. The set that owes
most of them decides:

- `starved`: it got fewer cells than a detection needs.
- `elsewhere`: it got as many or more, but other ones: for example the margin by which it is
  dilated, or the first part of a pattern.

The policy could not demand more:

- `too few returns`: enough rays hit it; or the wedge of an image box was demanded and lies beside
  it; or a full scan has too few returns on it.

For a policy without a camera, the first three reasons describe what the camera would have shown.
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
"""The shares that are counted. For CARE layer 1 is U; for care-sbf layers 1 and 2 are U and M. A
policy with a layer for every shell of distance has dozens; the later ones share one entry.
"""
_LAST_OWN, _LATER, _FLOOR = 2, 3, 4
"""Places in RAY_SHARES. Stages up to the first have their own share."""


@dataclass(frozen=True)
class ServedDemand:
    """A policy's demand at a keyframe and its allocation: all cells `fired` (n,), and those fired
    for every stage of the demand (`took`), exploitation first. The floor fired the others.
    """

    demand: Demand
    fired: Cells
    took: tuple[Cells, ...]

    @classmethod
    def of(cls, demand: Demand, fired: Cells, rig: Rig) -> "ServedDemand":
        """Return the record of a demand whose allocation, floor included, is `fired`. Cells that
        fire together as a unit belong to the stage of the unit's first demanded cell.
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
        """Return all demanded sets, in order of stage and set."""
        return [*chain(*stages_of(self.demand))]


def rays_by_share(returns: Cells, served: ServedDemand) -> Integers:
    """Return (5,) the number of rays of each of `RAY_SHARES` that hit an object.

    `returns` (P,) are the cells of all returns that a full scan has on it. A cell with two returns
    counts twice, since the detector gets two.
    """
    counts = np.zeros(len(RAY_SHARES), np.int64)
    for stage, cells in enumerate(served.took):
        counts[stage if stage <= _LAST_OWN else _LATER] += _hits(returns, cells)
    counts[_FLOOR] = _hits(returns, served.fired) - counts.sum()
    return counts


def shares_of_credit(rays: Integers) -> Floats:
    """Return (e, 5) the credit of each share for each of e sightings, in proportion to the rays (e,
    5) that hit it. A sighting has a total credit of 1, or 0 without rays.
    """
    totals = rays.sum(axis=1, keepdims=True)
    parts: Floats = np.divide(rays, totals, out=np.zeros(rays.shape), where=totals > 0)
    return parts


def _hits(returns: Cells, cells: Cells) -> int:
    return int(np.isin(returns, cells).sum())


@dataclass(frozen=True)
class ReserveUse(Adding):
    """Use of the reserve by the camera's wedges, as sums over keyframes (paper, Sec. 5.2, "The
    near-tie is mechanical").

    At `filled` of the `keyframes` the unexplained wedges U take the whole rest of the budget after
    exploitation. Nothing is then left to the explained wedges M or to the floor. At `filled_rho`
    keyframes U takes at least the reserve's own rho B. `explained_cells` are the cells of M outside
    U, which the residual filter removes. `untaken_cells` are those of them that exploitation had
    not taken.
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
    """Return the sums of one keyframe: exploitation takes `hulls`, U is `unexplained` and M is
    `by_memory`.
    """
    exploited, taken = taken_by_stage(Demand(hulls, [unexplained]), budget, reserve_fraction)
    removed = np.setdiff1d(_union(by_memory), _union(unexplained))
    return ReserveUse(
        keyframes=1,
        filled=int(len(exploited) + len(taken) == budget),
        # The share of exploitation is rounded, and the reserve keeps the rest.
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
    """An object at its first keyframe. This is truth, for the scoring only.

    `returns` (P,) are the cells of a full scan's returns on it. `wedges` are the cells of its b
    image boxes that reached the policy; `explained` (b,) marks boxes that a forecast explains.
    `tracked` is True if it already has a track, from beyond the scored range.
    """

    returns: Cells
    wedges: tuple[Cells, ...]
    explained: Mask
    tracked: bool = False

    @property
    def falsely_explained(self) -> bool:
        """Return True if only forecasts of other objects explain it: it has image boxes, all are
        explained, and it has no track.
        """
        return bool(self.wedges) and bool(self.explained.all()) and not self.tracked


def miss_reason(seen: Appearance, served: ServedDemand, min_returns: int) -> str:
    """Return the `MISS_REASONS` entry of an undetected object; a detection needs at least
    `min_returns` returns.
    """
    hit = np.isin(seen.returns, served.fired)
    if hit.sum() >= min_returns or len(seen.returns) < min_returns:
        return TOO_FEW_RETURNS
    asked = np.unique(np.concatenate([*served.sets, np.empty(0, np.int64)]))
    if np.isin(seen.returns, asked).sum() >= min_returns:
        return _of_budget(seen.returns[~hit], served, min_returns)
    if not seen.wedges:
        return NOT_IN_PICTURE
    # A demanded wedge lies beside the object: otherwise the object's cells would be demanded.
    if any(np.isin(wedge, asked).all() for wedge in seen.wedges):
        return TOO_FEW_RETURNS
    return EXPLAINED if seen.explained.all() else NOT_DEMANDED


def _of_budget(owed: Cells, served: ServedDemand, min_returns: int) -> str:
    """Return the reason if the budget ended before the cells `owed` (n,) were fired."""
    # Every set that still owes a cell was cut off. The set that owes most, the first of equals,
    # would have detected the object.
    debts = [int(np.isin(owed, cells).sum()) for cells in served.sets]
    debtor = served.sets[int(np.argmax(debts))]
    return STARVED if np.isin(debtor, served.fired).sum() < min_returns else ELSEWHERE
