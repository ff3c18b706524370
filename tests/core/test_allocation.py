import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate, budget_cells, half_up, taken_by_stage
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.firing.actions import Allocator, scores_of
from care_sim.core.firing.base import fired_cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from tests.helpers.floors import FLOOR, drawn_floors, floor_order

CELLS = 40
sets = st.lists(st.lists(st.integers(0, CELLS - 1), max_size=12), max_size=4)
demands = st.builds(Demand, exploitation=sets, layers=st.lists(sets, max_size=3))
floors = st.permutations(range(CELLS))
budgets = st.integers(1, CELLS)
fractions = st.sampled_from([0.0, 0.15, 0.3, 0.5, 1.0])


def in_turns(sets, limit, taken):
    """One cell a set and round, while a round adds any."""
    before = -1
    while before < len(taken) < limit:
        before = len(taken)
        for one in sets:
            left = [cell for cell in one if cell not in taken]
            taken.extend(left[: min(1, limit - len(taken))])


def by_the_letter(demand, budget, reserve_fraction, floor):
    """Algorithm 1 once more, in the simplest words."""
    taken = []
    in_turns(demand.exploitation, half_up((1 - reserve_fraction) * budget), taken)
    for layer in demand.layers:
        in_turns(layer, budget, taken)
    rest = [cell for cell in floor or () if cell not in taken]
    return taken + rest[: budget - len(taken)]


@pytest.mark.smoke
def test_worked_by_hand():
    """Ten cells, three reserved. Overlaps cost no turn; two cells left over by exploitation go to
    the layers.
    """
    demand = Demand(
        exploitation=[[1, 2, 3], [2, 3, 4, 5], []],
        layers=[[[5, 6], [0, 6, 7]], [[9, 8, 30]]],
    )
    assert allocate(demand, 10, 0.3).tolist() == [1, 2, 3, 4, 5, 6, 0, 7, 9, 8]


@pytest.mark.parametrize(
    ("budget", "rho", "share"), [(1638, 0.3, 1147), (100, 0.3, 70), (492, 0.3, 344), (11, 0.5, 6)]
)
def test_exploitation_stops_at_its_cap(budget, rho, share):
    assert len(allocate(Demand(exploitation=[range(5000)]), budget, rho)) == share


def test_sets_in_any_order_and_below_zero_are_taken_as_they_are():
    """The policies' door refuses what the grid does not have; the allocator knows no grid."""
    assert allocate(Demand([[7, -3, 7], [-3, 12]], [[[5, 4]]]), 5, 0.0).tolist() == [
        7,
        -3,
        12,
        5,
        4,
    ]


def test_cells_further_apart_than_any_grid_are_refused():
    with pytest.raises(InvalidInput, match=r"cells must lie in 0..16777216, got 1099511627776"):
        allocate(Demand([[3, 2**40]]), 1, 0.0)


@pytest.mark.parametrize("floor", [0.0, "ab", [0.5], [[1]], object()])
def test_a_floor_of_another_form_is_refused(floor):
    with pytest.raises(InvalidInput, match="floor must be a"):
        allocate(Demand([[1]]), 4, 0.5, floor)


@given(demands, budgets, fractions)
def test_what_the_stages_take_is_what_each_adds_by_the_letter(demand, budget, rho):
    taken = []
    in_turns(demand.exploitation, half_up((1 - rho) * budget), taken)
    expected = [[*taken]]
    for layer in demand.layers:
        before = len(taken)
        in_turns(layer, budget, taken)
        expected.append(taken[before:])
    assert [took.tolist() for took in taken_by_stage(demand, budget, rho)] == expected


@pytest.mark.smoke
@given(demands, budgets, fractions, floors)
def test_agrees_with_the_algorithm_by_the_letter(demand, budget, rho, floor):
    assert allocate(demand, budget, rho, floor).tolist() == by_the_letter(
        demand, budget, rho, floor
    )
    assert allocate(demand, budget, rho).tolist() == by_the_letter(demand, budget, rho, None)


@pytest.mark.smoke
@given(demands, budgets, fractions, drawn_floors)
def test_an_allocation_survives_the_way_through_an_action(demand, budget, rho, floor):
    scores = scores_of(allocate(demand, budget, rho), (4, 10))
    fired = fired_cells(scores, budget, floor)
    order = floor_order(floor, CELLS)
    assert fired.tolist() == sorted(allocate(demand, budget, rho, order).tolist())


def test_a_full_size_allocation_survives_the_way_through_an_action(grid):
    """Sixteen thousand distinct scores must stay distinct in float32."""
    order = np.random.default_rng(0).permutation(grid.size)
    scores = scores_of(order, grid.shape)
    assert scores.dtype == np.float32
    assert scores.min() > 0
    assert scores.max() <= 1
    assert set(fired_cells(scores, 1000, None).tolist()) == set(order[:1000].tolist())


def test_equal_scores_fire_by_ascending_index():
    scores = np.full((4, 10), 0.5, np.float32)
    scores[3, 9] = 0.6
    assert fired_cells(scores, 3, None).tolist() == [0, 1, 39]


def test_only_strictly_positive_scores_count():
    scores = np.zeros((4, 10), np.float32)
    scores[0, 3], scores[0, 4] = 1e-30, -1.0
    assert fired_cells(scores, 5, None).tolist() == [3]
    assert fired_cells(np.zeros((4, 10), np.float32), 5, None).tolist() == []


def test_too_few_scores_are_topped_up_from_the_floor_in_its_order():
    scores = np.zeros((4, 10), np.float32)
    first, second, third = floor_order(FLOOR, 40)[:3].tolist()
    scores.flat[second] = 1.0
    assert fired_cells(scores, 3, FLOOR).tolist() == sorted([first, second, third])


def test_a_boolean_mask_within_the_budget_is_an_action():
    mask = np.zeros((4, 10), bool)
    mask[1, 2:5] = True
    assert fired_cells(mask, 3, None).tolist() == [12, 13, 14]
    free = [cell for cell in floor_order(FLOOR, 40).tolist() if cell not in (12, 13, 14)]
    assert fired_cells(mask, 4, FLOOR).tolist() == sorted([12, 13, 14, free[0]])


@pytest.mark.parametrize(
    ("budget", "cells", "expected"), [(0.1, 16384, 1638), (0.03, 16384, 492), (1.0, 7, 7)]
)
def test_the_budget_is_rounded(budget, cells, expected):
    assert budget_cells(budget, cells) == expected


@pytest.mark.parametrize("budget", [0.0, -0.1, 1.01, float("nan"), 1e-6])
def test_a_budget_out_of_its_domain_is_refused_by_name(budget):
    with pytest.raises(InvalidInput, match="budget"):
        budget_cells(budget, 16384)


@pytest.mark.parametrize("demand", [b"x", None, [[1, 2]]])
def test_what_is_no_demand_is_refused_in_one_line(demand):
    with pytest.raises(InvalidInput, match=r"^demand must be a Demand, got "):
        allocate(demand, 3, 0.3)


def test_worlds_round_a_half_share_up_as_one_does():
    """With 5 cells a reserve of a half leaves 3 to exploitation, not the even 2."""
    rig = Rig(budget=5, reserve_fraction=0.5)
    hulls, wedges = np.arange(10), np.arange(50, 60)
    alone = allocate(Demand([hulls], [[wedges]]), 5, 0.5)
    stages = [WorldSets(CellSets.of([own]), np.array([1])) for own in (hulls, wedges)]
    scores = Allocator(rig, 1).scores(stages, np.array([5]))
    assert sorted(alone.tolist()) == np.flatnonzero(scores.ravel()).tolist() == [0, 1, 2, 50, 51]
