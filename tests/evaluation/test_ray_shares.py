import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.allocation import allocate
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.evaluation.rays import RAY_SHARES, ServedDemand, rays_by_share, shares_of_credit

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
    """Of ten cells exploitation may take seven, but asks for two; the wedge takes three, of which
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
