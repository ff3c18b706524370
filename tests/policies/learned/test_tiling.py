import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.policies.learned.tiling import Tiling, reserve_demand, sector_demand

GRID = AngularGrid(columns=4, rows=4)
RIG = Rig(GRID, budget=4)
QUARTERS = Tiling(GRID, 2, 2)
SCORES = np.array([[0.1, 0.2], [0.3, 0.4]])
NOTHING = Belief(
    Ego(),
    4,
    ImageDetections.from_rows(np.empty((0, 9))),
    Tracks.from_rows(np.empty((0, 13))),
    np.zeros((4, 4)),
)


def test_tiles_are_counted_from_the_top_row_and_from_straight_behind():
    assert QUARTERS.cells.tolist() == [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]]
    assert QUARTERS.shape == (2, 2)
    assert QUARTERS.tile_shape == (2, 2)


def test_the_best_come_first_ties_by_index_and_none_that_is_not_positive():
    ranked = QUARTERS.ranked(np.array([[0.2, -0.1], [0.9, 0.2]]), 16)
    assert [cells[0] for cells in ranked] == [8, 0, 10]
    assert QUARTERS.ranked(np.zeros((2, 2)), 16) == []
    sectors = Tiling(AngularGrid())
    equal = sectors.ranked(np.tile([0.5, 0.25], 64), 10**6)
    assert np.array_equal(equal, np.concatenate([sectors.cells[::2], sectors.cells[1::2]]))


def test_no_more_tiles_than_hold_enough():
    assert [len(QUARTERS.ranked(np.ones((2, 2)), cells)) for cells in (0, 1, 4, 5, 100)] == [
        0,
        1,
        1,
        2,
        4,
    ]


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


def test_sectors_become_layers_behind_the_hulls():
    demand = reserve_demand(NOTHING, RIG, QUARTERS, SCORES)
    assert len(demand.exploitation) == 0
    assert [[cells.tolist() for cells in layer] for layer in demand.layers] == [
        [[10, 11, 14, 15]],
        [[8, 9, 12, 13]],
    ]


def test_sectors_alone_fill_the_budget_best_first():
    demand = sector_demand(RIG, QUARTERS, SCORES)
    assert allocate(demand, 4, 0.3).tolist() == [10, 11, 14, 15]
    assert sector_demand(RIG, QUARTERS, -SCORES).layers == []


def test_equal_scores_go_by_ascending_sector():
    """Also where a network is so sure that its scores are equal in float32."""
    scores = np.tanh(np.array([[12, 14], [13, 15]], np.float32))
    assert len(np.unique(scores)) == 1
    assert allocate(sector_demand(RIG, QUARTERS, scores), 4, 0.3).tolist() == [0, 1, 4, 5]
