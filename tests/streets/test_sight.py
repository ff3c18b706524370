"""An ego that drives on by a line across the road, and lines of sight past what hides somebody."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.streets.sight import (
    EGO_LENGTH_M,
    EGO_WIDTH_M,
    Approach,
    Line,
    hides,
    needed_s,
    sight_of,
)
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk
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


places = st.tuples(st.floats(-10, 10), st.floats(-10, 10))


@pytest.mark.parametrize(
    ("start", "end", "hidden"),
    [
        ((-5.0, 0.0), (5.0, 0.0), True),
        ((-5.0, 1.1), (5.0, 1.1), False),
        ((-5.0, 0.0), (-2.1, 0.0), False),
        ((2.1, 0.0), (5.0, 0.0), False),
        # Past a corner, and over it.
        ((1.0, 3.2), (4.0, 0.2), False),
        ((1.0, 1.8), (4.0, -1.2), True),
        ((0.0, -5.0), (0.0, 5.0), True),
    ],
)
@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_a_body_four_by_two_metres_hides_what_is_behind_it(start, end, hidden, turn):
    cos, sin = np.cos(turn), np.sin(turn)
    eye, point = ([[cos * x - sin * y + 30.0, sin * x + cos * y - 7.0]] for x, y in (start, end))
    seen_past = hides((30.0, -7.0, turn), (4.0, 2.0), np.array(eye), np.array(point))
    assert seen_past.tolist() == [hidden]


@given(start=places, end=places, turn=st.floats(-4, 4))
def test_a_line_is_cut_where_it_runs_within_the_body(start, end, turn):
    shares = np.linspace(0.0, 1.0, 500)[:, None]
    points = np.array(start) + shares * (np.array(end) - start)
    cos, sin = np.cos(turn), np.sin(turn)
    along, across = points @ (cos, sin), points @ (-sin, cos)
    within = np.maximum(np.abs(along) - 2.0, np.abs(across) - 1.0)
    (hidden,) = hides((0.0, 0.0, turn), (4.0, 2.0), np.array([start]), np.array([end]))
    # Between two points a line may cut a corner: no more is asked of it than they are apart.
    if within.min() < -1e-9:
        assert hidden
    if within.min() > 0.06:
        assert not hidden


TIGHT_M = 8.0
BEYOND_M = 6.0


def test_who_is_seen_from_the_middle_of_a_turn_is_in_sight_for_as_long_as_the_rest_takes():
    # 4 m/s all the way: 40 m along x, a quarter turn to the left, and on along x = 48.
    legs = ((40.0, 0.0), (TIGHT_M * np.pi / 2, 1 / TIGHT_M), (60.0, 0.0))
    plan = SpeedPlan(Route(legs=legs), 4.0, 2.0, 1.5)
    line_m = 40.0 + TIGHT_M * np.pi / 2 + BEYOND_M
    approach = Approach.along(plan, line_m, line_m)
    line = Line((48.0, TIGHT_M + BEYOND_M, np.pi / 2), 1)
    arrival = approach.arrival(line, 0.33)

    # Somebody stands 4 m to the left; 0.3 m behind the front of 0.73 m is x = 44.065. At 45 degrees
    # of the turn the LiDAR, 0.445 m behind the middle, is at (45.342, 2.029). From there the line
    # of sight meets y = 13 at x = 44.172: there a wall ends that begins six metres to the left.
    walk = Walk((44.0, TIGHT_M + BEYOND_M), 0.0, 2.8, 5.6, 20.0)
    length, width, _ = CATALOGUE["wall"].size
    wall = 44.172 - length / 2, 13.0 - width / 2, 0.0
    hit_s = walk.duration_to(4.0)
    sight = sight_of(approach, arrival, walk, 0.73, "wall", wall, hit_s, hit_s)

    expected = (TIGHT_M * np.pi / 4 + BEYOND_M - EGO_LENGTH_M / 2 - 0.33) / 4.0
    # The approach is known every 0.25 m, which take 0.06 s.
    assert expected - 0.07 < sight.seconds <= expected + 0.001
    assert sight.spare_s == pytest.approx(sight.seconds - needed_s(4.0))
    assert sight.yaws
    (eye, seen), *_ = sight.lines
    assert eye == pytest.approx((45.342, 2.029), abs=0.25)
    assert seen == pytest.approx((44.065, 14.0))

    # A wall four metres further to the left hides nobody.
    aside = 40.0 - length / 2, 13.0 - width / 2, 0.0
    assert sight_of(approach, arrival, walk, 0.73, "wall", aside, hit_s, hit_s) is None


@pytest.mark.parametrize(("speed", "hides_long"), [(4.0, True), (8.0, False)])
def test_who_was_in_sight_just_before_does_not_count_as_hidden(speed, hides_long):
    """A bicycle between hides the line of sight over 7.5 m of the way: 1.9 s or 0.9 s."""
    plan = SpeedPlan(Route(legs=((200.0, 0.0),)), speed, 2.0, 1.5)
    approach = Approach.along(plan, 80.0, 80.0)
    arrival = approach.arrival(Line((80.0, 0.0, 0.0), 1), 0.33)
    walk = Walk((80.0, 6.0), -np.pi / 2, 2.8, 5.6, 20.0)
    hit_s = walk.duration_to(6.0)
    found = sight_of(approach, arrival, walk, 0.73, "bicycle", (70.0, 3.0, 0.0), hit_s, hit_s)
    assert (found is not None) is hides_long
