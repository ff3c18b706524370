import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate, budget_cells, half_up, taken_by_stage
from care_sim.core.firing.actions import scores_of
from care_sim.core.firing.base import fired_cells
from care_sim.core.types import Demand

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


def turn_by_turn(sets, limit, chosen):
    """The round-robin as nested loops, fast enough for the whole grid."""
    queues = [iter(np.unique(cells).tolist()) for cells in sets]
    while queues and len(chosen) < limit:
        waiting = []
        for queue in queues:
            for cell in queue:
                if cell not in chosen:
                    break
            else:
                continue
            chosen[cell] = None
            if len(chosen) == limit:
                return
            waiting.append(queue)
        queues = waiting


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


def test_a_taken_cell_costs_its_set_no_turn():
    demand = Demand(exploitation=[[1, 10, 11], [1, 20, 21], [1, 30, 31]])
    assert allocate(demand, 7, 0.0).tolist() == [1, 20, 30, 10, 21, 31, 11]


def test_a_set_is_taken_in_its_order_and_a_cell_once():
    assert allocate(Demand(exploitation=[[9, 3, 7, 3]]), 9, 0.0).tolist() == [9, 3, 7]


def test_nearer_sets_come_first_in_every_round():
    demand = Demand(exploitation=[[30, 31], [10, 11], [20, 21]])
    assert allocate(demand, 4, 0.0).tolist() == [30, 10, 20, 31]


@pytest.mark.parametrize(
    ("budget", "rho", "share"), [(1638, 0.3, 1147), (100, 0.3, 70), (492, 0.3, 344), (11, 0.5, 6)]
)
def test_exploitation_stops_at_its_cap(budget, rho, share):
    assert len(allocate(Demand(exploitation=[range(5000)]), budget, rho)) == share


def test_a_large_set_cannot_starve_a_small_one():
    demand = Demand(exploitation=[range(1000), range(5000, 5010)])
    chosen = allocate(demand, 40, 0.5)
    assert set(range(5000, 5010)) <= set(chosen.tolist())


def test_layers_inherit_what_exploitation_leaves():
    demand = Demand(exploitation=[range(5)], layers=[[range(100, 200)]])
    chosen = allocate(demand, 50, 0.3)
    assert len(chosen) == 50
    assert np.sum(chosen >= 100) == 45


def test_layers_fill_in_priority_order():
    demand = Demand(layers=[[range(30)], [range(100, 130)]])
    assert allocate(demand, 40, 0.3).tolist() == [*range(30), *range(100, 110)]


def test_a_burst_of_reserve_cells_never_displaces_exploitation():
    hulls = [range(70)]
    quiet = allocate(Demand(hulls), 100, 0.3)
    burst = allocate(
        Demand(hulls, [[range(1000 + 50 * n, 1050 + 50 * n) for n in range(60)]]), 100, 0.3
    )
    assert quiet.tolist() == burst[:70].tolist()


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


@pytest.mark.parametrize("cells", [[0.5], np.ones((2, 2), int), np.ones(4, bool)])
def test_what_is_no_list_of_indices_is_refused(cells):
    with pytest.raises(InvalidInput, match="a set of cells must be a list of cell indices"):
        allocate(Demand([[1, 2], cells]), 5, 0.3)


def test_the_floor_comes_last_and_skips_what_is_taken():
    floor = [3, 1, 8, 2, 9]
    assert allocate(Demand([[1]], [[[2]]]), 4, 0.5, floor).tolist() == [1, 2, 3, 8]


@pytest.mark.parametrize("floor", [0.0, "ab", [0.5], [[1]], object()])
def test_a_floor_of_another_form_is_refused(floor):
    with pytest.raises(InvalidInput, match="floor must be a"):
        allocate(Demand([[1]]), 4, 0.5, floor)


def test_without_floor_the_rest_is_unspent():
    assert allocate(Demand([[1]], [[[2]]]), 10, 0.5).tolist() == [1, 2]
    assert allocate(Demand(), 10, 0.3).tolist() == []


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


@given(
    st.lists(st.lists(st.tuples(*4 * [st.integers(0, 40)]), max_size=12), min_size=1, max_size=3),
    st.data(),
)
def test_agrees_with_nested_loops_over_rectangles_of_the_grid(grid, rectangles, data):
    table = np.arange(grid.size).reshape(grid.shape)
    sets = [[table[r : r + h, c : c + w].ravel() for c, w, r, h in some] for some in rectangles]
    budget = data.draw(st.integers(1, 1 + sum(len(cells) for some in sets for cells in some)))
    expected = {}
    turn_by_turn(sets[0], round(0.7 * budget), expected)
    for layer in sets[1:]:
        turn_by_turn(layer, budget, expected)
    assert allocate(Demand(sets[0], sets[1:]), budget, 0.3).tolist() == [*expected]


@pytest.mark.smoke
@given(demands, budgets, fractions, floors)
def test_never_overspends_repeats_or_wavers(demand, budget, rho, floor):
    chosen = allocate(demand, budget, rho, floor).tolist()
    assert len(chosen) == len(set(chosen)) == budget
    assert allocate(demand, budget, rho, floor).tolist() == chosen


@pytest.mark.smoke
@given(demands, budgets, fractions, floors)
def test_an_allocation_survives_the_way_through_an_action(demand, budget, rho, floor):
    scores = scores_of(allocate(demand, budget, rho), (4, 10))
    fired = fired_cells(scores, budget, lambda: np.array(floor))
    assert fired.tolist() == sorted(allocate(demand, budget, rho, floor).tolist())


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
    scores[0, 3] = 1.0
    floor = np.array([3, 39, 20, 0, *[n for n in range(40) if n not in (3, 39, 20, 0)]])
    assert fired_cells(scores, 3, lambda: floor).tolist() == [3, 20, 39]


def test_enough_scores_leave_the_floor_out():
    scores = np.zeros((4, 10), np.float32)
    scores[0, :3] = 1.0
    assert fired_cells(scores, 3, lambda: np.arange(39, -1, -1)).tolist() == [0, 1, 2]


def test_a_boolean_mask_within_the_budget_is_an_action():
    mask = np.zeros((4, 10), bool)
    mask[1, 2:5] = True
    assert fired_cells(mask, 3, None).tolist() == [12, 13, 14]
    assert fired_cells(mask, 4, lambda: np.arange(40)).tolist() == [0, 12, 13, 14]


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
