"""Differences between two policies, by keyframe and by event."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import Cells


class Adding:
    """Sums that add, column by column: those of scenes give those of all of them."""

    def __add__(self, other: Self) -> Self:
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return type(self)(*(ours + theirs for ours, theirs in pairs))


@dataclass(frozen=True)
class AllocationDifference(Adding):
    """Sums over keyframes. Allocations differ at `differing` of the `keyframes`, by `cells` in
    all.
    """

    keyframes: int = 0
    differing: int = 0
    cells: int = 0

    @property
    def share(self) -> float:
        """Share of keyframes with different allocations; nan without a keyframe."""
        return self.differing / self.keyframes if self.keyframes else float("nan")

    @property
    def cells_where_differing(self) -> float:
        """Mean number of cells at the keyframes at which the allocation differs; 0 where it never
        does.
        """
        return self.cells / self.differing if self.differing else 0.0


def allocation_difference(ours: Sequence[Cells], theirs: Sequence[Cells]) -> AllocationDifference:
    """Compare the cells fired at every keyframe. The order of selection is ignored, and a cell
    fired n times counts n times.

    Allocations differ by the cells that only one of them fires; of two unequal sides the larger
    counts. At the same budget this is the number of cells fired elsewhere. Raises InvalidInput for
    unequal lengths.
    """
    if len(ours) != len(theirs):
        raise InvalidInput(
            f"allocations must be of the same keyframes, got {len(ours)} and {len(theirs)}"
        )
    # Sums and not means are kept, so that scenes add up to what one pass over all of them gives.
    moved = [_moved(a, b) for a, b in zip(ours, theirs, strict=True)]
    return AllocationDifference(len(moved), sum(cells > 0 for cells in moved), sum(moved))


def _moved(ours: Cells, theirs: Cells) -> int:
    # With equal sizes both sides have equally many cells of their own. Otherwise the larger side
    # has more, and its surplus counts too.
    size = max(ours.max(initial=0), theirs.max(initial=0)) + 1
    shared = np.minimum(np.bincount(ours, minlength=size), np.bincount(theirs, minlength=size))
    return max(len(ours), len(theirs)) - int(shared.sum())


@dataclass(frozen=True)
class DetectionOrder(Adding):
    """Events that the first policy detected earlier, later, or at the same keyframe as the second
    (paper, Sec. 5.5). If neither detects an event within the censoring time, they tie.
    """

    earlier: int = 0
    later: int = 0
    tied: int = 0


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
