"""The cars that hide a target in the Euro NCAP tests: where they stand, who knows of them."""

import numpy as np
import pytest

from care_sim.scenarios.ncap.table import TESTS
from care_sim.world.bodies import CATALOGUE
from tests.helpers.ncap_worlds import RIGHT_HAND, built, ends_of

EGO_LENGTH, EGO_WIDTH, _ = CATALOGUE["ego"].size


def test_the_child_is_hidden_by_two_cars_of_the_protocols_sizes():
    world = built("CPNCO-50", ends_of("CPNCO-50")[1], seed=RIGHT_HAND)
    small, large, child = world.actors
    x, y, _ = child.pose_at(-10.0)
    world_x = EGO_LENGTH / 2 + 4.0 * 60 / 3.6 + CATALOGUE["child"].size[1] / 2
    (sx, sy, _), (lx, ly, _) = small.pose_at(0.0), large.pose_at(0.0)
    world.close()
    assert (x, y) == pytest.approx((world_x, -4.0))
    assert sx + small.kind.size[0] / 2 == pytest.approx(x - 0.298 / 2 - 1.0)
    assert lx + large.kind.size[0] / 2 == pytest.approx(sx - small.kind.size[0] / 2 - 1.0)
    assert ly + large.kind.size[1] / 2 == pytest.approx(-EGO_WIDTH / 2 - 1.0)
    assert sy == pytest.approx(ly)
    assert 4.1 <= small.kind.size[0] <= 4.4
    assert 4.3 <= large.kind.size[0] <= 4.7
    assert small.label == large.label == 0


@pytest.mark.parametrize("name", ["CBNA-50", "CBNAO-50", "CBFA-50"])
def test_two_cars_stand_in_line_beside_the_bicyclists_way(name):
    world = built(name, ends_of(name)[0], seed=RIGHT_HAND)
    large, small, bicyclist = world.actors
    line, rides_from, _ = bicyclist.pose_at(-10.0)
    far = 1.0 if name == "CBFA-50" else -1.0
    assert np.sign(rides_from) == far
    end = TESTS[name].obstruction.end_m
    for car in (large, small):
        x, y, _ = car.pose_at(0.0)
        length, width, _ = car.kind.size
        assert x + width / 2 == pytest.approx(line - 0.5 / 2 - TESTS[name].obstruction.before_m)
        assert far * y - length / 2 == pytest.approx(end)
        end += length + 0.2
    world.close()


@pytest.mark.parametrize(("name", "side"), [("CCCscp-far", 1.0), ("CCCscp-near", -1.0)])
def test_three_cars_wait_beside_the_ego_on_the_side_of_the_crossing_car(name, side):
    world = built(name, ends_of(name)[0], seed=RIGHT_HAND)
    *cars, crossing = world.actors
    line, comes_from, _ = crossing.pose_at(0.0)
    assert np.sign(comes_from) == side
    front = line - TESTS[name].obstruction.before_m
    for car in cars:
        x, y, _ = car.pose_at(0.0)
        length, width, _ = car.kind.size
        assert x + length / 2 == pytest.approx(front)
        assert side * y - width / 2 == pytest.approx(TESTS[name].obstruction.beside_m)
        front -= length + 1.0
    world.close()


@pytest.mark.parametrize("name", [name for name in TESTS if TESTS[name].obstruction])
@pytest.mark.parametrize("reported", [True, False])
def test_the_cars_that_hide_are_reported_or_not(name, reported):
    world = built(name, ends_of(name)[0], occluder_reported=reported)
    cars = [actor.label is not None for actor in world.actors if actor is not world.first_sighting]
    target = world.first_sighting.label
    world.close()
    assert cars == [reported] * (3 if name.startswith("CCC") else 2)
    assert target is not None
