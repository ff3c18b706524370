import math

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.differences import AllocationDifference, allocation_difference


def cells(*numbers):
    return np.array(numbers, np.int64)


def test_three_keyframes_by_hand():
    """The same cells in another order; two of three fired elsewhere; one cell not spent."""
    ours = [cells(1, 2, 3), cells(4, 5, 6), cells(7, 8)]
    theirs = [cells(3, 1, 2), cells(6, 7, 8), cells(7)]
    difference = allocation_difference(ours, theirs)
    assert difference == allocation_difference(theirs, ours) == AllocationDifference(3, 2, 2 + 1)
    assert difference.share == pytest.approx(2 / 3)
    assert difference.cells_where_differing == 1.5


def test_a_cell_that_is_fired_more_often_differs_by_its_shots():
    """Both fire 1, one of them three times: two of its shots went elsewhere."""
    difference = allocation_difference([cells(1, 1, 1, 2)], [cells(1, 2, 3, 4)])
    assert difference == AllocationDifference(1, 1, 2)


def test_equal_allocations_and_none():
    assert allocation_difference([cells(1)], [cells(1)]).cells_where_differing == 0
    assert math.isnan(allocation_difference([], []).share)
    assert allocation_difference([cells()], [cells()]) == AllocationDifference(1, 0, 0)


def test_scenes_add():
    assert AllocationDifference(40, 7, 100) + AllocationDifference(
        39, 0, 0
    ) == AllocationDifference(79, 7, 100)


def test_other_keyframes_are_refused():
    with pytest.raises(InvalidInput, match="must be of the same keyframes, got 1 and 0"):
        allocation_difference([cells(1)], [])
