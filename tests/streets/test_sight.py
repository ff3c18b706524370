"""Lines of sight past what hides somebody."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.streets.sight import EGO_LENGTH_M, Approach, Line, hides, needed_s, sight_of
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk
from care_sim.world.route import Route, SpeedPlan

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


RADIUS_M = 8.0
BEYOND_M = 6.0


def test_who_is_seen_from_the_middle_of_a_turn_is_in_sight_for_as_long_as_the_rest_takes():
    # 4 m/s all the way: 40 m along x, a quarter turn to the left, and on along x = 48.
    legs = ((40.0, 0.0), (RADIUS_M * np.pi / 2, 1 / RADIUS_M), (60.0, 0.0))
    plan = SpeedPlan(Route(legs=legs), 4.0, 2.0, 1.5)
    line_m = 40.0 + RADIUS_M * np.pi / 2 + BEYOND_M
    approach = Approach.along(plan, line_m, line_m)
    line = Line((48.0, RADIUS_M + BEYOND_M, np.pi / 2), 1)
    arrival = approach.arrival(line, 0.33)

    # Somebody stands 4 m to the left; 0.3 m behind the front of 0.73 m is x = 44.065. At 45 degrees
    # of the turn the LiDAR, 0.445 m behind the middle, is at (45.342, 2.029). From there the line
    # of sight meets y = 13 at x = 44.172: there a wall ends that begins six metres to the left.
    walk = Walk((44.0, RADIUS_M + BEYOND_M), 0.0, 2.8, 5.6, 20.0)
    length, width, _ = CATALOGUE["wall"].size
    wall = 44.172 - length / 2, 13.0 - width / 2, 0.0
    hit_s = walk.duration_to(4.0)
    sight = sight_of(approach, arrival, walk, 0.73, "wall", wall, hit_s, hit_s)

    expected = (RADIUS_M * np.pi / 4 + BEYOND_M - EGO_LENGTH_M / 2 - 0.33) / 4.0
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


def test_an_ego_needs_less_time_where_it_is_slow():
    assert needed_s(30 / 3.6) == pytest.approx(0.2 + 0.3 + 30 / 3.6 / 10)
    assert needed_s(4.0) == pytest.approx(0.9)
