from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.allocation import allocate
from care_sim.core.firing.actions import (
    ALONG,
    CHOSEN,
    EXPLOITATION,
    FLOOR,
    NOT_FIRED,
    RESERVE,
    scores_of,
    shares_of,
)
from care_sim.core.firing.base import fired_cells
from care_sim.core.firing.floor import Floor
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand

GRID = AngularGrid(columns=4, rows=3)
RIG = Rig(GRID, budget=6, reserve_fraction=0.5)
DRAWN = Floor(1, 2, 50)
"""Its first two cells of twelve are 11 and 10."""
DEMAND = Demand([np.array([0, 1, 2, 3, 4])], [[np.array([2, 3])]])
"""Three of six cells are for exploitation: 0, 1, 2. The reserve wants 2, which is taken, and 3."""


def shares(demand, behind, rig=RIG):
    """The shares of the cells that `demand` fires; `behind` is the demand that the watcher believes
    in.
    """
    action = scores_of(allocate(demand, rig.budget, rig.reserve_fraction), rig.grid.shape)
    return shares_of(fired_cells(action, rig.budget, DRAWN), action, behind, rig)


def test_every_cell_has_the_share_that_took_it():
    expected = np.full(12, NOT_FIRED)
    expected[[0, 1, 2]], expected[3], expected[[11, 10]] = EXPLOITATION, RESERVE, FLOOR
    np.testing.assert_array_equal(shares(DEMAND, DEMAND), expected.reshape(3, 4))


@pytest.mark.parametrize("behind", [None, Demand([np.array([7])])], ids=["raw", "another demand"])
def test_without_the_demand_behind_it_an_action_tells_no_more_than_what_it_chose(behind):
    expected = np.full(12, NOT_FIRED)
    expected[[0, 1, 2, 3]], expected[[11, 10]] = CHOSEN, FLOOR
    np.testing.assert_array_equal(shares(DEMAND, behind), expected.reshape(3, 4))


cells = (
    st.lists(st.integers(0, 11), max_size=6, unique=True)
    .map(np.array)
    .map(lambda a: a.astype(np.int64))
)
demands = st.builds(
    Demand, st.lists(cells, max_size=3), st.lists(st.lists(cells, max_size=2), max_size=2)
)


@given(demands, st.integers(1, 12), st.floats(0, 1))
def test_shares_are_the_order_of_the_allocator(demand, budget, reserve_fraction):
    rig = Rig(GRID, budget=budget, reserve_fraction=reserve_fraction)
    found = shares(demand, demand, rig).ravel()
    order = allocate(demand, budget, reserve_fraction)
    kinds = found[order].tolist()
    assert kinds == sorted(kinds)
    assert set(kinds) <= {EXPLOITATION, RESERVE}
    assert kinds.count(EXPLOITATION) <= round((1 - reserve_fraction) * budget)
    wanted = {int(cell) for cells in demand.exploitation for cell in cells}
    assert {int(cell) for cell in order if found[cell] == EXPLOITATION} <= wanted
    assert np.count_nonzero(found) == budget
    assert np.count_nonzero(found == FLOOR) == budget - len(order)


def test_what_fires_along_has_the_share_of_the_first_of_its_unit():
    """Segments of two: cells 0 and 2 are for exploitation, 7 is for the reserve, and the floor
    begins with 11. Cell 3 fires for 2, and 6 for 7.
    """
    rig = Rig(GRID, budget=8, reserve_fraction=0.5, firing="segments:2")
    demand = Demand([np.array([0, 2])], [[np.array([7, 3])]])
    action = scores_of(allocate(demand, rig.budget, rig.reserve_fraction), GRID.shape)
    fired = rig.hardware.fire(action, rig.budget, DRAWN, np.empty(0, np.int64))
    expected = np.full(12, NOT_FIRED)
    expected[:4], expected[6:8], expected[10:] = EXPLOITATION, RESERVE, FLOOR
    np.testing.assert_array_equal(shares_of(fired, action, demand, rig).ravel(), expected)
    expected[:8] = np.where(expected[:8], CHOSEN, NOT_FIRED)
    np.testing.assert_array_equal(shares_of(fired, action, None, rig).ravel(), expected)


def test_what_a_window_fires_unasked_is_no_floor():
    """The demand names a cell of the first of the columns 1 and 2."""
    rig = replace(RIG, firing="azimuth-window:180", budget=6)
    demand = Demand(layers=[[np.array([5])]])
    action = scores_of(np.array([5]), RIG.grid.shape)
    fired = rig.hardware.fire(action, rig.budget, None, np.array([1, 2, 5, 6, 9, 10]))
    found = shares_of(fired, action, demand, rig)
    expected = [[0, RESERVE, ALONG, 0]] * 3
    np.testing.assert_array_equal(found, expected)
