"""Routes of straights and bends: known ways, and places found again."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim import InvalidInput
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route, RouteCar, through
from care_sim.world.traffic import Traffic

LEGS = st.lists(
    st.tuples(st.floats(1.0, 40.0), st.floats(-0.15, 0.15)), min_size=0, max_size=4
).map(tuple)


def test_a_quarter_turn_to_the_left_ends_where_the_circle_does():
    route = Route((1.0, 2.0, 0.0), ((10.0, 0.0), (8.0 * np.pi / 2, 1 / 8.0), (5.0, 0.0)))
    assert route.pose(10.0) == pytest.approx((11.0, 2.0, 0.0))
    assert route.pose(10.0 + 4.0 * np.pi) == pytest.approx((19.0, 10.0, np.pi / 2))
    assert route.pose(route.length) == pytest.approx((19.0, 15.0, np.pi / 2))
    # Beyond both ends it goes on straight.
    assert route.pose(route.length + 3.0) == pytest.approx((19.0, 18.0, np.pi / 2))
    assert route.pose(-4.0) == pytest.approx((-3.0, 2.0, 0.0))


def test_curvature_is_that_of_the_leg():
    route = Route(legs=((10.0, 0.0), (5.0, -0.1), (5.0, 0.2)))
    places = [-1.0, 9.9, 10.1, 14.9, 15.1, 19.9, 20.1]
    assert [route.curvature(s) for s in places] == [0.0, 0.0, -0.1, -0.1, 0.2, 0.2, 0.0]


@given(LEGS, st.floats(-20.0, 150.0), st.floats(-3.0, 3.0))
@example(((1.0, 2.2e-311),), 1.5, 1.0)
def test_a_place_beside_the_line_is_found_again(legs, s, d):
    route = Route((3.0, -2.0, 0.7), legs)
    x, y, heading = route.pose(s)
    point = np.array([[x - d * np.sin(heading), y + d * np.cos(heading)]])
    ((found_s, found_d, found_heading),) = route.places(point)
    # A way that turns back on itself may pass nearer elsewhere, never farther away.
    assert abs(found_d) <= abs(d) + 1e-9
    if abs(found_s - s) < 1.0:
        assert found_s == pytest.approx(s, abs=1e-6)
        assert found_d == pytest.approx(d, abs=1e-6)
        assert found_heading == pytest.approx(heading, abs=1e-6)
    else:
        assert sum(abs(length * bend) for length, bend in legs) > np.pi / 2


@given(LEGS, st.floats(-5.0, 100.0), st.floats(0.0, 20.0))
def test_a_step_along_the_line_is_no_longer_than_its_way(legs, s, step):
    route = Route(legs=legs)
    here, there = np.array(route.pose(s)), np.array(route.pose(s + step))
    assert np.hypot(*(there - here)[:2]) <= step + 1e-9


def test_corners_are_rounded_by_arcs_that_touch_both_sides():
    route = through([(0.0, 0.0), (30.0, 0.0), (30.0, -20.0)], radius_m=8.0)
    assert route.pose(22.0) == pytest.approx((22.0, 0.0, 0.0))
    assert route.pose(22.0 + 4.0 * np.pi) == pytest.approx((30.0, -8.0, -np.pi / 2))
    assert route.pose(route.length) == pytest.approx((30.0, -20.0, -np.pi / 2))


def test_what_is_no_route_is_refused():
    with pytest.raises(InvalidInput, match="too close for bends of 8"):
        through([(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)], radius_m=8.0)
    with pytest.raises(InvalidInput, match="length of a leg"):
        Route(legs=((0.0, 0.0),))
    with pytest.raises(InvalidInput, match="curvature of a leg"):
        Route(legs=((1.0, 2.0),))


def test_a_car_on_a_straight_route_moves_as_highway_env_moves_it():
    ego = Traffic((1,), ego_lane=0, lane_width=3.5, speed_limit=20.0)
    driven = ego.add_ego(0.0, 8.0, CATALOGUE["ego"])
    car = RouteCar(Route(), 8.0)
    for acceleration in [1.0] * 10 + [-5.0] * 60:
        driven.accelerate(acceleration, 0.05)
        ego.step(0.05)
        car.accelerate(acceleration, 0.05)
        assert car.pose == pytest.approx(driven.pose, abs=1e-9)
        assert car.speed == pytest.approx(driven.speed, abs=1e-9)
    assert car.speed == 0.0


def test_a_car_turns_as_its_route_bends():
    car = RouteCar(Route(legs=((1.0, 0.0), (20.0, 0.1))), 4.0)
    assert car.yaw_rate == 0.0
    before = car.pose[2]
    for _ in range(20):
        car.accelerate(0.0, 0.1)
    assert car.yaw_rate == pytest.approx(0.4)
    assert car.pose[2] - before == pytest.approx(0.1 * 7.0)
