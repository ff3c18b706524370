import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.policies.learned.sectors import Tiling

GRID = AngularGrid(columns=4, rows=4)
QUARTERS = Tiling(GRID, 2, 2)


def test_tiles_are_counted_from_the_top_row_and_from_straight_behind():
    assert QUARTERS.cells.tolist() == [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]]
    assert QUARTERS.shape == (2, 2)
    assert QUARTERS.tile_shape == (2, 2)


def best(tiling, scores, enough):
    """The tiles that `Tiling.ranked` gives for one picture."""
    (ranked,), (count,) = tiling.ranked(np.array([scores]), enough)
    return ranked[:count].tolist()


def test_the_best_come_first_ties_by_index_and_none_that_is_not_positive():
    assert best(QUARTERS, [[0.2, -0.1], [0.9, 0.2]], 16) == [2, 0, 3]
    assert best(QUARTERS, np.zeros((2, 2)), 16) == []
    sectors = Tiling(AngularGrid())
    equal = best(sectors, np.tile([0.5, 0.25], 64), 10**6)
    assert equal == [*range(0, 128, 2), *range(1, 128, 2)]


def test_no_more_tiles_than_hold_enough():
    counts = [len(best(QUARTERS, np.ones((2, 2)), cells)) for cells in (0, 1, 4, 5, 100)]
    assert counts == [0, 1, 1, 2, 4]


def test_every_picture_is_ranked_by_itself():
    scores = np.array([[[0.2, 0.1], [0.0, 0.3]], [[-1, -1], [-1, 2]], [[-1, -1], [-1, -1]]])
    ranked, counts = QUARTERS.ranked(scores, 16)
    assert counts.tolist() == [3, 1, 0]
    assert ranked[0].tolist() == [3, 0, 1, 2]
    assert ranked[1, 0] == 3


@given(st.sampled_from([1, 2, 4, 8, 16, 512]), st.sampled_from([1, 2, 4, 32]))
def test_the_tiles_part_the_grid(azimuths, elevations):
    tiling = Tiling(AngularGrid(), azimuths, elevations)
    assert np.array_equal(np.sort(tiling.cells.ravel()), np.arange(AngularGrid().size))
    tall, wide = tiling.tile_shape
    rows, columns = np.divmod(tiling.cells, 512)
    assert np.array_equal(
        rows // tall * azimuths + columns // wide, np.indices(tiling.cells.shape)[0]
    )


@pytest.mark.parametrize(("azimuths", "elevations"), [(3, 4), (0, 4), (32, 5), (32, 64), (1.5, 4)])
def test_tiles_that_do_not_divide_the_grid_are_refused(azimuths, elevations):
    with pytest.raises(InvalidInput, match=r"azimuths|elevations"):
        Tiling(AngularGrid(), azimuths, elevations)
