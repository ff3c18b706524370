"""Planned encounters: their draws, and what their geometry promises."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.streets.encounters import (
    AT_GARDEN,
    AT_KERB,
    AT_YARD,
    COMERS,
    ENCROACHMENT_S,
    MOST_SIGHT_S,
    Course,
    Spot,
    draw_encounter,
)
from care_sim.streets.layouts import LAYOUTS
from care_sim.streets.sight import EGO_WIDTH_M, Approach
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route, SpeedPlan

PLACE_M = 250.0
APPROACH = Approach.along(SpeedPlan(Route(legs=((400.0, 0.0),)), 8.0, 2.0, 1.5), PLACE_M, PLACE_M)
every_seed = given(seed=st.integers(0, 2**32))


@cache
def drawn(seed):
    """A road and an encounter on it, None where none fitted."""
    rng = np.random.default_rng(seed)
    road = LAYOUTS[str(rng.choice(["straight", "junction", "one-way"]))](rng).main
    return road, draw_encounter(rng, Spot(road, (PLACE_M, PLACE_M)), APPROACH)


def middle_at(one, seconds):
    """How far the middle of who comes still is from the middle of the ego's lane."""
    return abs(one.from_d) - one.walk.covered(seconds)


@every_seed
def test_who_comes_is_in_sight_for_as_long_as_is_stated(seed):
    _, one = drawn(seed)
    if one:
        # 8 m/s ask for 0.5 s and the half of 1.6 s.
        assert 1.3 - 1e-6 <= one.sight.seconds <= MOST_SIGHT_S
        assert one.sight.spare_s == pytest.approx(one.sight.seconds - 1.3)
        low, high = COMERS[one.who].speed_mps
        assert low <= one.walk.speed <= high


@every_seed
def test_the_course_is_what_an_ego_that_drives_on_meets(seed):
    _, one = drawn(seed)
    if one is None:
        return
    length = CATALOGUE[one.who].size[0]
    touching = (EGO_WIDTH_M + length) / 2
    # `lead_s` after setting off the ego's front is at the line.
    when_there = middle_at(one, one.lead_s)
    if one.course is Course.CONFLICT:
        assert abs(when_there) < touching
    elif one.course is Course.NEAR_MISS:
        least, most = ENCROACHMENT_S
        assert middle_at(one, one.lead_s - least) <= -touching + 1e-6
        assert middle_at(one, one.lead_s - most) >= -touching - 1e-6
    else:
        assert middle_at(one, 60.0) > touching


@every_seed
def test_who_waits_is_behind_the_occluder_and_all_its_way_is_beyond_its_end(seed):
    road, one = drawn(seed)
    if one is None:
        return
    length, width, _ = CATALOGUE[one.occluder].size
    side = road.side(one.side)
    at_kerb = sum(AT_KERB.get(one.who, ()), ())
    assert one.occluder in {*at_kerb, *AT_GARDEN, *AT_YARD}
    # In the frame of the occluder, whose length lies along the road.
    x, y, heading = one.occluder_pose
    cos, sin = np.cos(heading), np.sin(heading)
    start_x, start_y = one.walk.start[0] - x, one.walk.start[1] - y
    along, across = cos * start_x + sin * start_y, cos * start_y - sin * start_x
    assert along - CATALOGUE[one.who].size[1] / 2 > length / 2
    front = one.side * across - CATALOGUE[one.who].size[0] / 2
    assert front > -width / 2
    if abs(one.from_d) < side.kerb_m:
        assert abs(one.from_d) > side.lane_edge_m


@pytest.mark.parametrize("reported", [True, False])
def test_an_occluder_is_reported_if_its_kind_has_a_class(reported):
    kinds = {
        one.occluder
        for _, one in map(drawn, range(400))
        if one and one.occluder_reported is reported
    }
    assert kinds == (
        {"car", "van", "truck", "bus"}
        if reported
        else {"skip", "trailer", "hoarding", "wall", "hedge", "building"}
    )


def test_all_who_can_come_do_from_both_sides():
    met = {(one.who, one.side) for _, one in map(drawn, range(400)) if one}
    assert met == {(who, side) for who in COMERS for side in (-1, 1)}
