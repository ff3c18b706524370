"""What a choice of cells holds in memory, on the largest grid."""

import tracemalloc
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest

from care_sim.core.allocation import allocate
from care_sim.core.firing.actions import scores_of
from care_sim.core.firing.floor import RandomFloor
from care_sim.envs.sensing import sensing
from care_sim.policies import make_policy
from care_sim.sensors.setups import sensor_setup
from tests.bench.choices import observation

MOST_BYTES_A_CELL = 30
"""Held at once are the floor, 8 bytes a cell, the scores of an action, 4, a flag, 1, and the lists
of the cells that are demanded and fired. A table with one flag per cell and track would be 40.
"""


@pytest.mark.parametrize("policy", ["care", "care-sbf", "care-sightlines"])
def test_a_choice_makes_no_table_of_cells_by_tracks(policy):
    """In NumPy; compiled code's own arrays are as long as its sets of cells."""
    finest = sensor_setup("os1-128")
    sensor = replace(finest, grid=replace(finest.grid, columns=2048))
    with gymnasium.make("care_sim:CARE-Dense-v0", sensor=sensor, disable_env_checker=True) as env:
        rig = sensing(env).rig
        asked = make_policy(policy, env)
    asked.reset()
    floors = RandomFloor(np.random.SeedSequence(0), 0, rig.grid.size)
    seen = [observation(rig, number) for number in range(2)]

    def choose(number):
        belief = rig.read(seen[number])
        asked.remember(belief)
        cells = allocate(asked.demand(belief), rig.budget, rig.reserve_fraction)
        scores = scores_of(cells, rig.grid.shape)
        floor = partial(floors.at, number)
        return rig.hardware.fire(scores, rig.budget, floor, np.empty(0, np.int64))

    # The first choice fills tables that are kept.
    choose(0)
    tracemalloc.start()
    fired = choose(1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(fired) == rig.budget
    assert peak < MOST_BYTES_A_CELL * rig.grid.size
