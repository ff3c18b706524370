"""Collisions that a stop avoids, and whom a collision is with, in worlds made by hand."""

from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest

from care_sim.core.types import CLASSES, Detections
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.scenarios.base import Scenario
from care_sim.study.rows.reading import is_avoided
from care_sim.world.traffic import Traffic
from care_sim.world.world import World
from tests.helpers.episodes import outcome

SPEED_MPS = 10.0
MADE_UP = f"{__name__}:MakesUpACar"
SILENT = f"{__name__}:Silent"


@dataclass(frozen=True)
class Followed(Scenario):
    """A child stands in the lane, and a car 5 m behind the ego never brakes."""

    def build(self, rng):
        """The world, the same for every seed."""
        world = _street()
        world.first_sighting = world.add("child", "child", (45.0, 0.0, 0.0))
        world.add("follower", "car", lambda time: (-9.5 + SPEED_MPS * time, 0.0, 0.0))
        return world


@dataclass(frozen=True)
class Hidden(Scenario):
    """A child walks out from behind a trailer 60 m ahead when a car that goes on has arrived."""

    car_ahead: bool = False

    def build(self, rng):
        """The world, the same for every seed."""
        world = _street()
        world.add("trailer", "trailer", (52.0, -3.0, 0.0), reported=False)
        world.first_sighting = world.add(
            "child", "child", lambda time: (60.0, min(-3.0 + 2.0 * max(time - 4.5, 0.0), 0.0), 1.57)
        )
        if self.car_ahead:
            world.add("car", "car", lambda time: (14.0 + SPEED_MPS * time, 0.0, 0.0))
        return world


class MakesUpACar:
    """Reports a car 12 m ahead, whatever is there."""

    def detect(self, points, sensor_height_m):
        """See `PointDetector`."""
        box = [[12.0, 0.0, -1.0, 4.6, 1.9, 1.5, 0.0]]
        return Detections(np.array([CLASSES.index("car")]), np.array(box), np.array([0]))


class Silent:
    """Reports nothing."""

    def detect(self, points, sensor_height_m):
        """See `PointDetector`."""
        return Detections(np.empty(0), np.empty((0, 7)), np.empty(0))


def _street():
    return World(Traffic((1,), 0, 3.5, 20.0), SPEED_MPS)


def played(scenario, **given):
    with closing(ScenarioEnv(scenario=scenario, budget=1.0, **given)) as env:
        return outcome(env, "full")


def test_whoever_runs_into_a_braking_car_is_named():
    seen = played(Followed)
    assert (seen["collision"], seen["hit_kind"], seen["hit_at_front"]) == (True, "car", False)
    assert 0.0 < seen["impact_speed_mps"] < SPEED_MPS
    assert seen["closing_speed_mps"] == pytest.approx(SPEED_MPS - seen["impact_speed_mps"])


def test_what_a_car_runs_into_is_named():
    blind = played(Followed, min_returns=10**6)
    assert (blind["collision"], blind["hit_kind"], blind["hit_at_front"]) == (True, "child", True)
    assert blind["impact_speed_mps"] == blind["closing_speed_mps"] == pytest.approx(SPEED_MPS)


def test_a_stop_for_a_car_that_a_detector_made_up_avoids_nothing():
    stopped = played(Hidden, detector=MADE_UP)
    assert (stopped["braked"], stopped["collision"]) == (True, False)
    assert stopped["braked_before_view"]
    assert not is_avoided(stopped)


@pytest.mark.parametrize("given", [{}, {"detector": SILENT}])
def test_a_stop_for_what_is_there_is_no_stop_for_nothing(given):
    came_of = played(Hidden, **given)
    assert came_of["braked"] == (not given)
    assert not came_of["braked_before_view"]
    assert is_avoided(came_of) == (not came_of["collision"])


def test_a_brake_behind_a_car_is_founded():
    came_of = played(Hidden, detector=MADE_UP, car_ahead=True)
    assert came_of["braked"]
    assert not came_of["braked_before_view"]
