"""How two policies differ keyframe by keyframe and event by event."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import Cells


@dataclass(frozen=True)
class AllocationDifference:
    """Sums over keyframes; they add. `differing` of the `keyframes` have allocations that differ,
    by `cells` in all.
    """

    keyframes: int = 0
    differing: int = 0
    cells: int = 0

    def __add__(self, other: "AllocationDifference") -> "AllocationDifference":
        sums = (getattr(self, column.name) + getattr(other, column.name) for column in fields(self))
        return AllocationDifference(*sums)

    @property
    def share(self) -> float:
        """Of the keyframes, those at which the allocation differs; nan without a keyframe."""
        return self.differing / self.keyframes if self.keyframes else float("nan")

    @property
    def cells_where_differing(self) -> float:
        """Mean number of cells at the keyframes at which the allocation differs; 0 where it never
        does.
        """
        return self.cells / self.differing if self.differing else 0.0


def allocation_difference(ours: Sequence[Cells], theirs: Sequence[Cells]) -> AllocationDifference:
    """Compare the cells fired at every keyframe: the order of selection does not count, and a cell
    that is fired n times counts n times.

    Allocations differ by the cells that one fires and the other does not, the larger side where the
    sizes differ: of two that spend the same budget, the cells that were fired elsewhere. Raises
    InvalidInput for unequal lengths.
    """
    if len(ours) != len(theirs):
        raise InvalidInput(
            f"allocations must be of the same keyframes, got {len(ours)} and {len(theirs)}"
        )
    # Sums and not means are kept, so that scenes add up to what one pass over all of them gives.
    moved = [_moved(a, b) for a, b in zip(ours, theirs, strict=True)]
    return AllocationDifference(len(moved), sum(cells > 0 for cells in moved), sum(moved))


def _moved(ours: Cells, theirs: Cells) -> int:
    # Of equal sizes both sides have as many cells of their own. Of unequal ones the larger side has
    # more: what it fired beyond the other counts, too.
    size = max(ours.max(initial=0), theirs.max(initial=0)) + 1
    shared = np.minimum(np.bincount(ours, minlength=size), np.bincount(theirs, minlength=size))
    return max(len(ours), len(theirs)) - int(shared.sum())


@dataclass(frozen=True)
class DetectionOrder:
    """Events that the first policy detected earlier, later, or at the same keyframe as the second;
    they add. Two that never detect it within the censoring time are tied.
    """

    earlier: int = 0
    later: int = 0
    tied: int = 0

    def __add__(self, other: "DetectionOrder") -> "DetectionOrder":
        return DetectionOrder(
            *(getattr(self, column.name) + getattr(other, column.name) for column in fields(self))
        )


def detection_order(ours: Sequence[int], theirs: Sequence[int]) -> DetectionOrder:
    """Compare the censored times to first detection, in keyframes, event by event. Raises
    InvalidInput for unequal lengths.
    """
    if len(ours) != len(theirs):
        raise InvalidInput(f"delays must be of the same events, got {len(ours)} and {len(theirs)}")
    leads = [their - our for our, their in zip(ours, theirs, strict=True)]
    return DetectionOrder(
        sum(lead > 0 for lead in leads),
        sum(lead < 0 for lead in leads),
        sum(lead == 0 for lead in leads),
    )
