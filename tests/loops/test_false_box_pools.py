"""The drive that lends an episode its false boxes."""

import numpy as np
import pytest

from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.false_box_pools import pool_of_another_drive
from care_sim.scenarios import SCENARIOS
from care_sim.sensors.pictures import FRONT_CAMERA

RIG = Rig(cameras=(FRONT_CAMERA,))


def lent(**returns):
    conditions = ClosedLoopConditions(camera_profile="yolox", **returns)
    seeds = SensorSeeds(*map(np.random.SeedSequence, range(4)))
    scenario = SCENARIOS["dense"]()
    world = scenario.build(np.random.default_rng(0))
    return pool_of_another_drive(world, scenario.duration_s, RIG, conditions, seeds)


@pytest.fixture(scope="module")
def clear():
    return lent()


@pytest.mark.parametrize(
    "returns",
    [
        # Seen from 1 m, nothing makes the car brake.
        {"lidar_stated_range_m": 1.0, "visibility_m": 20.0},
        {"lidar_crosstalk": 1.0},
    ],
    ids=lambda returns: next(iter(returns)),
)
def test_false_boxes_do_not_depend_on_what_returns(clear, returns):
    pool = lent(**returns)
    assert len(pool.rows)
    assert np.array_equal(pool.rows, clear.rows)
    assert np.array_equal(pool.times_s, clear.times_s)
