"""The pattern that is learned on a scenario's training seeds."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.rig import Rig
from care_sim.policies.controls.rehearsed import LearnedPlace, learned_cells
from care_sim.scenarios import make_scenario

GRID = Rig().grid


def hull_when_a_full_scan_finds_the_actor(seed, **parameters):
    with closing(gymnasium.make("CARE-Dartout-v0", budget=1.0, **parameters)) as env:
        env.reset(seed=seed)
        loop, info = env.unwrapped.loop, {"detected": False}
        while not info["detected"]:
            boxes = loop.sensor.boxes_to_local(loop.world.boxes([loop.world.first_sighting]))
            *_, info = env.step(np.ones(GRID.shape, np.float32))
        (hull,) = env.unwrapped.rig.hulls(boxes)
        return hull


def test_of_one_seed_it_fires_where_the_full_scan_first_finds_the_actor():
    hull = hull_when_a_full_scan_finds_the_actor(10_000)
    cells = learned_cells(Rig(), "dartout", 1)
    assert sorted(cells[: len(hull)]) == sorted(hull)
    assert sorted(cells) == [*range(GRID.size)]


def test_the_cells_that_held_most_actors_come_first():
    """At speeds so different they are found near and far, in many cells and in few."""
    speeds = {"ego_speed_mps": (4.0, 14.0)}
    hulls = [hull_when_a_full_scan_finds_the_actor(10_000 + n, **speeds) for n in range(3)]
    held = [sum(cell in hull for hull in hulls) for cell in range(GRID.size)]
    assert {*held} == {0, 1, 2, 3}
    found = learned_cells(Rig(), make_scenario("dartout", **speeds), 3)
    assert [held[cell] for cell in found] == sorted(held, reverse=True)


@pytest.mark.parametrize(("mirrored", "side"), [("never", -1), ("always", 1)])
def test_it_is_told_the_scenario_of_its_environment_with_its_parameters(mirrored, side):
    with closing(gymnasium.make("CARE-CutIn-v0", budget=0.03, mirrored=mirrored)) as env:
        policy = care_sim.make_policy("learned-place", env, seeds=2)
        env.reset(seed=0)
        cells = policy.demand(env.unwrapped.loop.belief).layers[0][0][:50]
        assert np.array_equal(np.sign(GRID.directions[cells][:, 1]), np.full(50, side))
        told = learned_cells(env.unwrapped.rig, make_scenario("cutin", mirrored=mirrored), 2)
        assert np.array_equal(cells, told[:50])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [({"scenario": "moon"}, "unknown scenario 'moon'"), ({"seeds": 0}, "seeds must be")],
)
def test_what_is_not_known_is_refused(parameters, message):
    with pytest.raises(InvalidInput, match=message):
        LearnedPlace(Rig(), **parameters)
