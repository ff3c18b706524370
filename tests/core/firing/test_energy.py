"""Shots are dealt by the scores; what cells are given is worked out by hand or one by one."""

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.base.errors import InvalidInput
from care_sim.core.firing.actions import scores_of
from care_sim.core.firing.base import shots_by_cell
from care_sim.core.firing.listing import hardware_of
from care_sim.core.grid import AngularGrid
from tests.helpers.floors import FLOOR, drawn_floors, floor_order

GRID = AngularGrid(columns=6, rows=3)
NOTHING = np.empty(0, np.int64)
scored = arrays(
    np.float32, GRID.shape, elements=st.sampled_from([-1.0, 0.0, 0.1, 0.2, 0.25, 0.5, 0.75, 1.0])
)
budgets = st.integers(0, GRID.size)
floors = st.none() | drawn_floors


def fire(name, scores, budget, floor=None):
    return hardware_of(name, GRID).fire(scores, budget, floor, NOTHING)


def shots(name, scores, budget, floor=None):
    """How often every cell that fires does."""
    return Counter(fire(name, scores, budget, floor).tolist())


def scores(**by_cell):
    table = np.zeros(GRID.size, np.float32)
    for cell, score in by_cell.items():
        table[int(cell[1:])] = score
    return table.reshape(GRID.shape)


@given(scored, budgets, floors)
def test_one_shot_is_a_free_cell(action, budget, floor):
    free = fire("cells", action, budget, floor)
    assert np.array_equal(fire("energy:1", action, budget, floor), free)


@given(scored, budgets, floors, st.integers(1, 5))
def test_no_action_overspends_and_no_cell_has_more_than_it_may(action, budget, floor, most):
    found = shots(f"energy:{most}", action, budget, floor)
    assert found.total() <= budget
    assert max(found.values(), default=0) <= most
    if floor is not None:
        assert found.total() == budget


@given(scored, budgets, st.integers(1, 5))
def test_every_shot_goes_to_the_highest_score_per_shot(action, budget, most):
    """Dealt one by one: of equals the cell with fewer shots, then the lower one."""
    flat = action.ravel().tolist()
    dealt = Counter()
    for _ in range(budget):
        open_cells = [c for c, score in enumerate(flat) if score > 0 and dealt[c] < most]
        if not open_cells:
            break
        best = min(open_cells, key=lambda c: (-Fraction(flat[c]) / (dealt[c] + 1), dealt[c], c))
        dealt[best] += 1
    assert shots(f"energy:{most}", action, budget) == dealt


def test_the_floor_comes_after_the_last_shot_of_the_last_demanded_cell():
    free = [cell for cell in floor_order(FLOOR, GRID.size).tolist() if cell not in (1, 4)]
    expected = {1: 3, 4: 3, free[0]: 1, free[1]: 1}
    assert shots("energy:3", scores(c1=1, c4=0.1), 8, FLOOR) == expected


@given(
    st.lists(st.tuples(st.integers(0, 17), st.integers(1, 4)), unique_by=lambda pair: pair[0]),
    st.integers(0, 10),
)
def test_an_action_can_ask_for_any_number_of_shots_of_every_cell(asked, more):
    """Shots that are left go on top of the shots that the action demanded."""
    cells, counts = (np.array([pair[n] for pair in asked], np.int64) for n in (0, 1))
    action = scores_of(cells, GRID.shape, counts)
    exact = shots("energy:4", action, int(counts.sum()))
    assert exact == dict(asked)
    beyond = shots("energy:4", action, int(counts.sum()) + more)
    assert all(beyond[cell] >= count for cell, count in asked)


@given(st.permutations(range(GRID.size)), budgets)
def test_a_demand_in_order_has_one_shot_each_as_long_as_its_cells_last(order, budget):
    action = scores_of(np.array(order), GRID.shape)
    assert shots("energy:4", action, budget) == dict.fromkeys(order[:budget], 1)


def test_shots_are_counted_by_cell():
    cells, none = shots_by_cell(np.array([1, 4, 9]), 12)
    assert cells.tolist() == [1, 4, 9]
    assert none is None
    cells, table = shots_by_cell(np.array([1, 4, 4, 9, 9, 9]), 12)
    assert cells.tolist() == [1, 4, 9]
    assert table.tolist() == [0, 1, 0, 0, 2, 0, 0, 0, 0, 3, 0, 0]


@pytest.mark.parametrize("most", ["0", "101"])
def test_a_number_of_shots_beyond_reason_is_refused_in_one_line(most):
    with pytest.raises(
        InvalidInput, match=rf"shots of firing energy must lie in \[1, 100\], got {most}"
    ):
        hardware_of(f"energy:{most}", GRID)
