"""How an ego that drives on as planned comes by a line across the road."""

import numpy as np
import pytest

from care_sim.streets.sight import EGO_LENGTH_M, EGO_WIDTH_M, Approach, Line
from care_sim.world.route import Route, SpeedPlan

HALF_M = 0.3
RADIUS_M = 10.0
EVENLY = {"cruise_mps": 4.0, "sideways_mps2": 2.0, "comfort_mps2": 1.5}


def turning(sign):
    legs = ((40.0, 0.0), (RADIUS_M * np.pi / 2, sign / RADIUS_M), (60.0, 0.0))
    return SpeedPlan(Route(legs=legs), **EVENLY)


@pytest.mark.parametrize("side", [-1, 1])
def test_on_a_straight_the_front_arrives_in_the_middle_of_the_lane(side):
    plan = SpeedPlan(Route(legs=((200.0, 0.0),)), **EVENLY)
    approach = Approach.along(plan, 80.0, 80.0)
    arrival = approach.arrival(Line((80.0, 0.0, 0.0), side), HALF_M)
    assert arrival.place_m == pytest.approx(80.0 - HALF_M - EGO_LENGTH_M / 2)
    assert arrival.time_s == pytest.approx((arrival.place_m - approach.places[0]) / 4.0)
    assert arrival.at_m == pytest.approx(0.0)
    assert arrival.reach_m == pytest.approx((-EGO_WIDTH_M / 2, EGO_WIDTH_M / 2))


@pytest.mark.parametrize("turn", [-1, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_where_a_turn_ends_the_front_arrives_outside_of_the_lane(turn, side):
    approach = Approach.along(turning(turn), 55.0, 55.0)
    line = Line((50.0, turn * RADIUS_M, turn * np.pi / 2), side)
    arrival = approach.arrival(line, 0.0)
    # The middle of the front runs on a wider circle about the same centre, beside which the line
    # begins: it is there before the ego's middle by the angle between both.
    front = np.hypot(RADIUS_M, EGO_LENGTH_M / 2)
    before = np.arctan2(EGO_LENGTH_M / 2, RADIUS_M)
    assert arrival.place_m == pytest.approx(40.0 + RADIUS_M * (np.pi / 2 - before), abs=0.01)
    assert arrival.at_m == pytest.approx(-turn * side * (front - RADIUS_M), abs=0.01)
    # Its outer corner goes widest, and the middle of its inner side stays nearest to the centre.
    outer = np.hypot(RADIUS_M + EGO_WIDTH_M / 2, EGO_LENGTH_M / 2) - RADIUS_M
    low, high = arrival.reach_m if turn * side < 0 else np.negative(arrival.reach_m[::-1])
    assert (low, high) == pytest.approx((-EGO_WIDTH_M / 2, outer), abs=0.02)


def test_behind_a_sharp_turn_the_last_time_at_a_line_counts():
    # The side street leads back: on its first straight the ego is ahead of the line already.
    legs = ((60.0, 0.0), (7.0 * np.deg2rad(105.0), 1 / 7.0), (60.0, 0.0))
    plan = SpeedPlan(Route(legs=legs), **EVENLY)
    along = 60.0 + 7.0 * np.deg2rad(105.0) + 1.0
    line = Line(plan.route.pose(along), 1)
    approach = Approach.along(plan, along, along)
    assert line.local(approach.eyes)[0, 0] > 0
    arrival = approach.arrival(line, HALF_M)
    assert arrival.place_m == pytest.approx(along - HALF_M - EGO_LENGTH_M / 2, abs=0.3)


def test_a_slow_turn_takes_time():
    plan = SpeedPlan(turning(1).route, 8.0, 2.0, 1.5)
    approach = Approach.along(plan, 80.0, 80.0)
    assert np.all(np.diff(approach.times) > 0)
    assert approach.times[-1] == pytest.approx(
        plan.seconds_to(float(approach.places[0]), float(approach.places[-1]), 8.0, 1.5), abs=0.02
    )
    assert approach.speeds.min() == pytest.approx(np.sqrt(2.0 * RADIUS_M), abs=0.05)
