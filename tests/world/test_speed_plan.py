"""How fast a car means to go along its route."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.world.route import Route, SpeedPlan

CRUISE, SIDEWAYS, COMFORT = 8.0, 2.0, 1.5
STRAIGHT = SpeedPlan(Route(legs=((200.0, 0.0),)), CRUISE, SIDEWAYS, COMFORT)


def turning(radius):
    return SpeedPlan(
        Route(legs=((60.0, 0.0), (10.0, 1 / radius), (60.0, 0.0))), CRUISE, SIDEWAYS, COMFORT
    )


def test_a_straight_is_driven_at_cruising_speed():
    assert [STRAIGHT.at(s) for s in (0.0, 77.7, 200.0, 300.0)] == [CRUISE] * 4


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


def test_times_on_the_way():
    assert STRAIGHT.times(np.array([10.0, 18.0, 34.0])).tolist() == pytest.approx([0.0, 1.0, 3.0])


def test_a_bend_on_the_way_costs_time():
    plan = turning(8.0)
    straight = 120.0 / CRUISE
    driven = plan.seconds_to(5.0, 125.0, CRUISE, COMFORT)
    # 10 m at 4 m/s instead of 8, and 16 m on either side at 6 m/s on average.
    assert driven - straight == pytest.approx(10 / 4 - 10 / 8 + 32 / 6 - 32 / 8, abs=0.1)
