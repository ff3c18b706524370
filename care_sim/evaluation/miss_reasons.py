"""Why a policy did not detect an object at its first keyframe, for every miss exactly one reason.

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

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.grid import Cells
from care_sim.evaluation.ray_shares import ServedDemand

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
