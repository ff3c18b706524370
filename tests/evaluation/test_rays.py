"""Where rays went, by hand. For reasons of misses: an object that returns in the cells 10 to 15, of
which three are needed.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.allocation import allocate
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.evaluation.rays import (
    ELSEWHERE,
    EXPLAINED,
    MISS_REASONS,
    NOT_DEMANDED,
    NOT_IN_PICTURE,
    RAY_SHARES,
    STARVED,
    TOO_FEW_RETURNS,
    Appearance,
    ReserveUse,
    ServedDemand,
    miss_reason,
    rays_by_share,
    reserve_use,
    shares_of_credit,
)

OBJECT = np.arange(10, 16)
WEDGE = np.array([3, 4, 5, 6, 10, 11, 12, 13, 14, 15])
"""Its upper margin comes first."""
HULL = np.array([20, 21, 22])
BESIDE = np.array([24, 25, 26])
NOTHING = np.array([], np.int64)


def seen(*explained, wedge=WEDGE, returns=OBJECT, tracked=False):
    """An object with an image box for each mark, which says whether a forecast explains it."""
    return Appearance(returns, (wedge,) * len(explained), np.array(explained, bool), tracked)


def reason(appearance, demand, budget, floor=NOTHING):
    fired = allocate(demand, budget, 0.3, floor)
    return miss_reason(appearance, ServedDemand.of(demand, fired, Rig(budget=budget)), 3)


REASONS = {
    "outside the pictures": (seen(), Demand([HULL]), 6, NOT_IN_PICTURE),
    "its only box is explained": (seen(True), Demand([HULL], [[BESIDE]]), 6, EXPLAINED),
    "one of two boxes is not": (seen(True, False), Demand([HULL]), 6, NOT_DEMANDED),
    "a policy without camera": (seen(False), Demand(), 6, NOT_DEMANDED),
    # 6 of 8 cells for exploitation, which needs 3; then the wedges take turns, 2 cells each.
    "two cells of the wedge": (
        seen(False), Demand([HULL], [[WEDGE, BESIDE]]), 7, STARVED,
    ),
    "five cells, four of the margin": (seen(False), Demand([HULL], [[WEDGE]]), 8, ELSEWHERE),
    "three of the wedge, all of the margin": (seen(False), Demand([HULL], [[WEDGE]]), 6, ELSEWHERE),
    "exploitation is cut off, too": (seen(), Demand([OBJECT, HULL]), 2, STARVED),
    "the wedge lies beside it": (
        seen(False, wedge=BESIDE), Demand([HULL], [[BESIDE]]), 6, TOO_FEW_RETURNS,
    ),
    "an explained box, asked for all the same": (
        seen(True, wedge=BESIDE), Demand([], [[BESIDE]]), 6, TOO_FEW_RETURNS,
    ),
    "rays enough, and not detected": (seen(), Demand([OBJECT]), 10, TOO_FEW_RETURNS),
    "two returns in all": (seen(returns=OBJECT[:2]), Demand(), 6, TOO_FEW_RETURNS),
}  # fmt: skip


@pytest.mark.parametrize("case", REASONS)
def test_each_reason_by_hand(case):
    appearance, demand, budget, expected = REASONS[case]
    assert reason(appearance, demand, budget) == expected


def test_rows_of_a_pattern_that_the_budget_cuts_off_are_starved():
    """Two cells of the object in each row: the first row is fired whole, the second not at all."""
    rows = [[np.array([8, 9, 10, 11])], [np.array([12, 13, 30, 31])]]
    assert reason(seen(), Demand(layers=rows), 4) == STARVED


def test_a_large_set_that_holds_one_cell_does_not_hide_that_its_own_wedge_starved():
    """A neighbour's hull got six cells, and owes one of the object's; the wedge owes six."""
    neighbour = np.array([40, 41, 42, 43, 44, 45, 10, 46])
    assert reason(seen(False), Demand([neighbour], [[WEDGE]]), 9) == ELSEWHERE
    assert reason(seen(False), Demand([neighbour], [[WEDGE]]), 7) == STARVED


def test_rays_of_the_floor_count():
    """Two cells of the wedge and one of the floor would have been enough."""
    assert reason(seen(False), Demand(), 3, floor=OBJECT) == TOO_FEW_RETURNS
    assert reason(seen(False), Demand(), 2, floor=OBJECT) == NOT_DEMANDED


@st.composite
def situations(draw):
    some = st.lists(st.integers(0, 19), max_size=6, unique=True).map(
        lambda numbers: np.array(numbers, np.int64)
    )
    sets = st.lists(some, max_size=3)
    boxes = draw(sets)
    marks = np.array([draw(st.booleans()) for _ in boxes], bool)
    appearance = Appearance(draw(some), tuple(boxes), marks)
    return appearance, Demand(draw(sets), draw(st.lists(sets, max_size=2))), draw(st.integers(0, 9))


@given(situations())
def test_a_miss_has_one_reason_and_the_budget_is_blamed_only_where_more_of_it_would_have_helped(
    situation,
):
    appearance, demand, budget = situation
    told = reason(appearance, demand, budget)
    assert told in MISS_REASONS
    # With a budget for everything that is asked, as many returns come as there are to be had.
    hits = np.isin(appearance.returns, allocate(demand, 1000, 0.3)).sum()
    if told in (STARVED, ELSEWHERE):
        assert hits >= 3
    elif told != TOO_FEW_RETURNS:
        assert hits < 3


CELLS = st.lists(st.integers(0, 29), max_size=8, unique=True).map(
    lambda cells: np.array(cells, np.int64)
)
SETS = st.lists(CELLS, max_size=3)


def cells(*numbers):
    return np.array(numbers, np.int64)


def served(demand, budget, rho=0.3, floor=None):
    floor = np.arange(30) if floor is None else floor
    rig = Rig(AngularGrid(columns=10, rows=3), budget=budget, reserve_fraction=rho)
    return ServedDemand.of(demand, allocate(demand, budget, rho, floor), rig)


def test_every_share_of_a_hull_a_wedge_and_a_floor_by_hand():
    """Exploitation may take seven of ten cells, but demands two. The wedge takes three, of which
    the hull had one; the floor begins with the cells 20 and 21. The object returns twice in 5.
    """
    demand = Demand([cells(1, 2)], [[cells(2, 5, 6, 7)]])
    got = served(demand, 7, floor=cells(20, 21, 22, *range(20)))
    assert [took.tolist() for took in got.took] == [[1, 2], [5, 6, 7]]
    assert rays_by_share(cells(2, 5, 5, 21, 29), got).tolist() == [1, 2, 0, 0, 1]


def test_layers_beyond_the_second_are_one_share():
    demand = Demand(layers=[[cells(1)], [cells(2)], [cells(3)], [cells(4)]])
    got = served(demand, 4)
    assert rays_by_share(cells(1, 2, 3, 4), got).tolist() == [0, 1, 1, 2, 0]


@given(SETS, st.lists(SETS, max_size=4), st.integers(0, 30), st.sampled_from([0.0, 0.3, 1.0]))
def test_the_shares_add_up_to_all_rays_that_hit(exploitation, layers, budget, rho):
    got = served(Demand(exploitation, layers), budget, rho)
    returns = np.repeat(np.arange(30), 2)
    assert rays_by_share(returns, got).sum() == 2 * len(got.fired)
    assert rays_by_share(returns, got).min() >= 0


def test_every_sighting_counts_one_and_one_without_a_ray_nothing():
    rays = np.array([[1, 3, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 9]])
    assert shares_of_credit(rays) == pytest.approx(
        np.array([[0.25, 0.75, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 1]])
    )
    assert shares_of_credit(np.empty((0, len(RAY_SHARES)))).shape == (0, 5)


def test_rays_that_fire_along_are_credited_to_the_stage_that_their_unit_fired_for():
    """Rows of ten cells: the hull in row 0 takes it, the wedge row 2, where its second cell is."""
    rig = Rig(AngularGrid(columns=10, rows=3), budget=20, reserve_fraction=0.5, firing="rows")
    demand = Demand([cells(3)], [[cells(4, 25)]])
    fired = np.concatenate([np.arange(10), np.arange(20, 30)])
    got = ServedDemand.of(demand, fired, rig)
    assert rays_by_share(cells(0, 3, 20, 29, 15), got).tolist() == [2, 2, 0, 0, 0]


def test_a_reserve_that_is_filled_by_hand():
    """With 10 cells exploitation takes 4 of its 7. U asks for 7, one of them a hull cell, and gets
    the 6 that are left. M has two cells outside U, and the hull has one of these.
    """
    unexplained = [cells(3, 10, 11, 12), cells(13, 14, 15)]
    by_memory = [cells(2, 10), cells(20, 11)]
    use = reserve_use([np.arange(4)], unexplained, by_memory, 10, 0.3)
    assert use == ReserveUse(1, filled=1, filled_rho=1, explained_cells=2, untaken_cells=1)


def test_the_reserves_own_share_is_less_than_what_exploitation_leaves():
    """Three cells are rho B, six are left."""
    use = reserve_use([np.arange(4)], [cells(10, 11, 12)], [], 10, 0.3)
    assert (use.filled, use.filled_rho) == (0, 1)
    use = reserve_use([np.arange(4)], [cells(10, 11)], [], 10, 0.3)
    assert (use.filled, use.filled_rho) == (0, 0)


def test_a_hull_cell_that_its_cap_left_out_is_not_taken():
    use = reserve_use([np.arange(30)], [], [cells(8, 29)], 10, 0.3)
    assert (use.explained_cells, use.untaken_cells) == (2, 2)
    use = reserve_use([np.arange(30)], [], [cells(6, 29)], 10, 0.3)
    assert (use.explained_cells, use.untaken_cells) == (2, 1)
