"""The way that a car is to go, and how fast."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim import InvalidInput
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route, RouteCar, SpeedPlan, through
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


CRUISE, SIDEWAYS, COMFORT = 8.0, 2.0, 1.5
STRAIGHT = SpeedPlan(Route(legs=((200.0, 0.0),)), CRUISE, SIDEWAYS, COMFORT)


def turning(radius):
    return SpeedPlan(
        Route(legs=((60.0, 0.0), (10.0, 1 / radius), (60.0, 0.0))), CRUISE, SIDEWAYS, COMFORT
    )


def test_a_bend_is_driven_with_the_sideways_acceleration_that_is_allowed():
    plan = turning(8.0)
    assert plan.at(65.0) == pytest.approx(4.0)
    # From 4 m/s, 12 m at 1.5 m/s^2 make sqrt(16 + 36) m/s.
    assert plan.at(48.0) == pytest.approx(np.sqrt(52), abs=0.06)
    assert plan.at(82.0) == pytest.approx(np.sqrt(52), abs=0.06)
    assert (plan.at(40.0), plan.at(90.0)) == (CRUISE, CRUISE)


@given(radius=st.floats(5, 100), start=st.floats(0, 129), ahead=st.floats(0.3, 40))
def test_no_change_of_speed_is_more_than_comfortable(radius, start, ahead):
    plan = turning(radius)
    gained = abs(plan.at(start + ahead) ** 2 - plan.at(start) ** 2)
    assert gained <= 2 * COMFORT * (ahead + 0.51)


def test_seconds_to_a_place():
    assert STRAIGHT.seconds_to(10.0, 50.0, CRUISE, 0.0) == pytest.approx(5.0)
    assert STRAIGHT.seconds_to(10.0, 50.0, 5.0, 0.0) == pytest.approx(8.0)
    assert STRAIGHT.seconds_to(50.0, 10.0, CRUISE, 0.0) == 0.0
    assert STRAIGHT.seconds_to(10.0, 50.0, 0.0, 0.0) == np.inf


def test_seconds_of_a_car_that_gains_speed():
    # 2 s at 1.5 m/s^2 from 5 m/s are 13 m and end at the cruising speed.
    assert STRAIGHT.seconds_to(0.0, 13.0, 5.0, 1.5) == pytest.approx(2.0, abs=0.01)
    assert STRAIGHT.seconds_to(0.0, 29.0, 5.0, 1.5) == pytest.approx(4.0, abs=0.01)


def test_a_car_that_goes_as_planned_goes_on_as_planned_behind_a_bend():
    plan = turning(8.0)
    # In the bend it gains nothing; behind its end, at 70 m, 12 m at 1.5 m/s^2 make sqrt(52) m/s.
    planned = plan.times(np.arange(65.0, 82.01, 0.25))[-1]
    assert planned == pytest.approx(5 / 4 + (np.sqrt(52) - 4) / 1.5, abs=0.1)
    assert plan.seconds_to(65.0, 82.0, 4.0, 0.0) == pytest.approx(planned)
    # One that somebody holds up stays as slow.
    assert plan.seconds_to(65.0, 82.0, 3.0, 0.0) == pytest.approx(17.0 / 3.0)
