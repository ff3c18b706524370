"""The worth of units, and how many shots known targets take; numbers by hand."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.cells.stack import GridStack
from care_sim.core.conditions import Conditions
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.own.care import CareSightlines
from care_sim.policies.own.care_units import CareUnits, TargetShots
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE

GRID = AngularGrid(columns=12, rows=6)


def test_with_free_cells_it_is_care_sightlines(encounter, environment):
    names = ("care-units", "care-sightlines")
    ours, theirs = (care_sim.make_policy(name, environment) for name in names)
    for observation in encounter:
        assert np.array_equal(ours(observation), theirs(observation))


@pytest.fixture
def asks(monkeypatch):
    """The cells that the allocator would take of `care-sightlines`, in order, are these."""

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
        # The first two cells are worth 3 + 2; the seam lies between their columns.
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


@pytest.mark.parametrize("firing", ["tiles", "azimuth-window"])
def test_what_it_demands_fires(firing):
    with gymnasium.make("CARE-Dense-v0", budget=0.05, firing=firing) as env:
        policy = care_sim.make_policy("care-units", env)
        observation, _ = env.reset(seed=0)
        for _ in range(5):
            action = policy(observation)
            observation, *_, info = env.step(action)
            assert {*np.flatnonzero(action).tolist()} <= {*info["fired"].tolist()}


FOG = {"lidar_stated_range_m": 20.0, "visibility_m": 50.0}


def rig(firing="energy:4", **settings):
    returns = Conditions(firing=firing, **settings).filmed
    return Rig(cameras=(FRONT_CAMERA,), budget=819, firing=firing, returns=returns)


def shots(rig, cells, belief):
    """The different shots of some cells."""
    return {*TargetShots(rig).of(belief)[cells].tolist()}


@pytest.mark.parametrize(
    ("metres", "needed"),
    [
        # r^2 exp(2 * 3.912 r / 50) / 20^2 of a car of the stated 10%.
        (8.0, 1),  # 0.56
        (10.0, 2),  # 1.20
        (12.0, 3),  # 2.35
        (13.5, 4),  # 3.77
        (14.0, 1),  # 4.38: four would not do, and one may if it is brighter
    ],
)
def test_the_hull_of_a_car_has_what_its_distance_takes_in_fog(belief_of, car, metres, needed):
    foggy = rig(**FOG)
    belief = belief_of([car(1, metres)])
    (hull,) = foggy.hulls(belief.tracks.boxes)
    assert shots(foggy, hull, belief) == {needed}
    elsewhere = np.setdiff1d(np.arange(foggy.grid.size), hull)
    assert shots(foggy, elsewhere, belief) == {1}


@pytest.mark.parametrize(("metres", "needed"), [(13.0, 1), (15.0, 2), (18.0, 4), (19.0, 1)])
def test_a_wedge_has_what_the_height_of_its_box_tells(belief_of, seen, metres, needed):
    """A person of 40% and 1.76 m: 0.81, 1.47, 3.39 and 4.41 times what one shot shows."""
    foggy = rig(**FOG)
    half = FRONT_CAMERA.focal * 1.76 / metres / 2
    boxes = seen(("pedestrian", 158.0, 90.0 - half, 162.0, 90.0 + half))
    belief = replace(belief_of(), detections=boxes)
    (wedge,) = wedges(boxes, foggy)
    assert shots(foggy, wedge, belief) == {needed}


def test_a_cell_of_two_targets_has_the_shots_of_the_one_that_needs_more(belief_of, car):
    foggy = rig(**FOG)
    belief = belief_of([car(1, 9.0), car(2, 13.5)])
    near, far = foggy.hulls(belief.tracks.boxes)
    assert shots(foggy, far, belief) == {4}
    assert shots(foggy, np.setdiff1d(near, far), belief) <= {1}


def test_each_lidar_has_the_shots_of_its_own_distance(belief_of, car, seen):
    """A car 13.5 m from the roof is 8 m from the LiDAR in the bumper; so is what a camera shows."""
    grid = AngularGrid(64, 8)
    pair = GridStack((grid, grid), ((0.0, 0.0, 0.0), (5.5, 0.0, -1.0)))
    foggy = replace(rig(**FOG), grid=pair)
    tracked = belief_of([car(1, 13.5)])
    half = FRONT_CAMERA.focal * CATALOGUE["car"].size[2] / (13.5 - FRONT_CAMERA.position[0]) / 2
    boxes = seen(("car", 158.0, 90.0 - half, 162.0, 90.0 + half))
    pictured = replace(belief_of(), detections=boxes)
    for sets, belief in (
        (foggy.hulls(tracked.tracks.boxes), tracked),
        (wedges(boxes, foggy), pictured),
    ):
        lidars = pair.lidars_of(sets[0])
        assert shots(foggy, sets[0][lidars == 0], belief) == {4}
        assert shots(foggy, sets[0][lidars == 1], belief) == {1}


def test_the_shots_that_care_units_asks_for_are_paid_and_fired():
    with gymnasium.make("CARE-Dense-v0", budget=0.03, firing="energy", **FOG) as env:
        policy = care_sim.make_policy("care-units", env)
        observation, _ = env.reset(seed=0)
        several = 0
        for _ in range(25):
            action = policy(observation)
            (cells,) = np.nonzero(action.ravel())
            asked = policy.demanded.shots[cells]
            assert asked.sum() <= 492
            observation, *_, info = env.step(action)
            fired = np.bincount(info["fired"], minlength=action.size)
            assert (fired[cells] >= asked).all()
            several = max(several, np.count_nonzero(asked > 1))
        assert several > 50


class Asks(Policy):
    """Three cells, of which the second is wanted three times."""

    shots = np.ones(32 * 512, np.int64)

    def demand(self, belief):
        return Demand([[7, 5, 9]], shots=self.shots)


def asking(firing, shots, belief_of):
    policy = Asks(rig(firing))
    policy.shots = shots
    return policy(belief_of().to_observation()).ravel()


def test_a_demand_of_any_policy_may_tell_shots(belief_of):
    wanted = np.ones(32 * 512, np.int64)
    wanted[5] = 3
    scores = asking("energy:4", wanted, belief_of)
    fired = rig().hardware.fire(scores.reshape(32, 512), 5, None, np.empty(0, np.int64))
    assert fired.tolist() == [5, 5, 5, 7, 9]
    # Hardware that fires every cell once takes the order and nothing else.
    scores = asking("cells", wanted, belief_of)
    assert np.argsort(-scores, kind="stable")[:3].tolist() == [7, 5, 9]


@pytest.mark.parametrize("bad", [np.ones(5, int), np.ones(32 * 512), np.zeros(32 * 512, int), "x"])
def test_other_shots_are_refused_in_one_line(belief_of, bad):
    with pytest.raises(InvalidInput, match="shots of a demand must be 16384 whole numbers of 1"):
        asking("energy:4", bad, belief_of)
