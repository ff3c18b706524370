from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.core.allocation import allocate
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.own.care import CareSightlines
from care_sim.policies.own.care_units import CareUnits

GRID = AngularGrid(columns=12, rows=6)


def test_with_free_cells_it_is_care_sightlines(encounter, environment):
    names = ("care-units", "care-sightlines")
    ours, theirs = (care_sim.make_policy(name, environment) for name in names)
    for observation in encounter:
        assert np.array_equal(ours(observation), theirs(observation))


@pytest.fixture
def asks(monkeypatch):
    """What the allocator would take of `care-sightlines`, in order, is these cells."""

    def asked(*cells):
        demand = Demand(layers=[[np.array(cells)]])
        monkeypatch.setattr(CareSightlines, "demand", lambda self, belief: demand)

    return asked


@pytest.mark.parametrize(
    ("firing", "cells", "budget", "units"),
    [
        # Four cells count 4, 3, 2, 1: the first row holds 4 + 1, the others 3 and 2.
        ("rows", (0, 13, 26, 5), 24, [0, 1]),
        # Five count 5 down to 1: the last three, of one row, are worth more than the first.
        ("rows", (0, 13, 24, 25, 26), 12, [2]),
        # Of columns 0 and 1 both first cells are worth 3 + 2; the seam lies between.
        ("azimuth-window:180", (11, 0, 6), 12, [11, 0]),
        # Rows 4 and 5 together are worth more than row 0 and its neighbour, the best row alone.
        ("vertical-window", (0, 48, 60, 61), 24, [4, 5]),
    ],
)
def test_the_units_that_are_worth_the_most_by_hand(asks, belief_of, firing, cells, budget, units):
    rig = Rig(GRID, budget=budget, firing=firing)
    asks(*cells)
    ranges = np.zeros(GRID.shape, np.float32)
    belief = replace(belief_of(ranges=ranges), budget=budget)
    demand = CareUnits(rig).demand(belief)
    taken = allocate(demand, budget, 0.3)
    assert [*dict.fromkeys(rig.hardware.unit_of[taken].tolist())] == units


@pytest.mark.parametrize("firing", ["tiles", "segments", "rows", "azimuth-window"])
def test_what_it_demands_fires(firing):
    with gymnasium.make("CARE-Dense-v0", budget=0.05, firing=firing) as env:
        policy = care_sim.make_policy("care-units", env)
        observation, _ = env.reset(seed=0)
        for _ in range(5):
            action = policy(observation)
            observation, *_, info = env.step(action)
            assert {*np.flatnonzero(action).tolist()} <= {*info["fired"].tolist()}
