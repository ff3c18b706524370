"""What is drawn of a drive."""

from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from care_sim.streets.draft import footprints_meet
from care_sim.streets.drive import LENGTH_M, draw_drive
from care_sim.streets.encounters import ENCROACHMENT_S, MOST_SIGHT_S, Course, Wanted, Way
from care_sim.streets.layouts import SPEED_LIMIT_MPS, Curve
from care_sim.streets.sight import EGO_LENGTH_M, EGO_WIDTH_M, Approach, hides, needed_s
from care_sim.world.bodies import CATALOGUE

SEEDS = (0, 2, 9, 12, 18, 19, 24, 25)
"""Straight, bent and turning off to both sides, with up to three to meet."""

MANY = (2, 7, 9, 12, 19, 27, 28, 42)
"""With every course on straights, in bends and in turns to both sides."""


@cache
def drawn(seed):
    return draw_drive(np.random.default_rng(seed), 6.0)


def test_the_same_generator_draws_the_same_drive():
    one, other = drawn(5), draw_drive(np.random.default_rng(5), 6.0)
    for field in fields(one):
        assert np.array_equal(getattr(one, field.name), getattr(other, field.name)) or (
            getattr(one, field.name) == getattr(other, field.name)
        )


@pytest.mark.parametrize("seed", SEEDS)
def test_encounters_lie_on_the_way_and_apart(seed):
    drive = drawn(seed)
    places = [one.along_m for one in drive.encounters]
    assert len(places) <= 3
    assert LENGTH_M[0] <= drive.goal_m <= LENGTH_M[1]
    assert drive.plan.route.length > drive.goal_m
    assert all(40.0 <= place < drive.goal_m for place in places)
    assert all(np.diff(places) >= 30.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_route_is_the_middle_of_the_egos_lanes(seed):
    drive = drawn(seed)
    for stretch in drive.stretches:
        for along in np.linspace(stretch.from_m, min(stretch.to_m, drive.goal_m), 7).tolist():
            place = np.array([along - stretch.offset_m, 0.0, 0.0])
            x, y, heading = stretch.road.curve.to_world(place)
            pose = drive.plan.route.pose(along)
            assert pose[:2] == pytest.approx((x, y), abs=1e-6)
            assert np.cos(pose[2] - heading) == pytest.approx(1.0)


def test_the_ego_turns_off_to_both_sides_and_goes_round_bends():
    turns = {
        np.sign(drawn(seed).plan.route.legs[1][1])
        for seed in SEEDS
        if len(drawn(seed).stretches) > 1
    }
    assert turns == {-1.0, 1.0}
    assert any(
        len(drawn(seed).stretches) == 1 and drawn(seed).plan.route.legs[0][0] < 100.0
        for seed in SEEDS
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_who_comes_waits_and_goes_where_nothing_stands(seed):
    drive = drawn(seed)
    standing = np.array([way[0] for way in drive.ways if (way == way[0]).all()])
    kinds = [
        kind for kind, way in zip(drive.kinds, drive.ways, strict=True) if (way == way[0]).all()
    ]
    sizes = np.array([CATALOGUE[kind].size[:2] for kind in kinds])
    for one in drive.encounters:
        size = np.array(CATALOGUE[one.who].size[:2])
        for seconds in np.arange(0.0, 20.0, 0.2).tolist():
            pose = np.broadcast_to(one.walk.pose(seconds), (len(standing), 3))
            meets = footprints_meet(
                pose,
                np.broadcast_to(size, (len(standing), 2)),
                standing,
                sizes,
                np.zeros(len(standing)),
            )
            assert not meets.any(), [kinds[n] for n in np.flatnonzero(meets)]


@cache
def encounters():
    """Drives and their encounters, of which some are in bends and some in turns."""
    drives = [draw_drive(np.random.default_rng(seed), 1.0) for seed in MANY]
    return [(drive, one) for drive in drives for one in drive.encounters]


def bends_within(drive, from_m, to_m):
    places = np.arange(from_m, to_m, 0.25).tolist()
    return any(drive.plan.route.curvature(place) for place in places)


def test_there_are_encounters_in_bends_and_in_turns_to_both_sides_from_both_sides():
    ways = {(one.way, one.side) for _, one in encounters()}
    assert ways == {(way, side) for way in Way for side in (-1, 1)}
    turns = {
        (np.sign(drive.plan.route.legs[1][1]), one.side)
        for drive, one in encounters()
        if one.way is Way.TURN
    }
    assert turns == {(turn, side) for turn in (-1, 1) for side in (-1, 1)}
    for drive, one in encounters():
        # The LiDAR is behind the ego's middle, and where it is, is known every 0.2 s.
        eyes = np.array([eye for eye, _ in one.sight.lines])
        places = drive.plan.route.places(eyes)[:, 0]
        assert bends_within(drive, places.min(), places.max() + 2.5) or one.way is Way.STRAIGHT
        assert not bends_within(drive, *places[[0, -1]]) or one.way is not Way.STRAIGHT
        assert len(drive.stretches) > 1 or one.way is not Way.TURN


def test_who_comes_is_in_sight_for_as_long_as_is_stated_wherever_they_come():
    for _, one in encounters():
        assert one.sight.seconds <= MOST_SIGHT_S
        assert one.sight.spare_s >= 0
        slowest, fastest = needed_s(3.0), needed_s(SPEED_LIMIT_MPS)
        assert slowest <= one.sight.seconds - one.sight.spare_s <= fastest


def apart_s(drive, one):
    """0 where the ego touches who comes; else by how many seconds at least it must be earlier or
    later to touch them; inf where 1.2 s are not enough.
    """
    approach = Approach.along(drive.plan, one.along_m, one.along_m)
    arrives = np.interp(one.arrival_m, approach.places, approach.times)
    size = np.array(CATALOGUE[one.who].size[:2])
    ego = np.array(CATALOGUE["ego"].size[:2])
    for late in np.arange(0.0, 1.2, 0.02).tolist():
        for sign in (1.0, -1.0):
            since = approach.times - arrives + one.lead_s - sign * late
            own = np.array([one.walk.pose(seconds) for seconds in since.tolist()])
            count = len(own)
            if footprints_meet(
                approach.poses,
                np.broadcast_to(ego, (count, 2)),
                own,
                np.broadcast_to(size, (count, 2)),
                np.zeros(count),
            ).any():
                return late
    return np.inf


def test_an_ego_that_drives_on_hits_in_a_conflict_alone():
    found = [(one, apart_s(drive, one)) for drive, one in encounters()]
    assert all(apart == 0.0 for one, apart in found if one.course is Course.CONFLICT)
    assert all(apart == np.inf for one, apart in found if one.course is Course.STOP)
    least, most = ENCROACHMENT_S
    passed = [apart for one, apart in found if one.course is Course.NEAR_MISS]
    # A corner of an ego that turns may come to the line a little before the middle of its front.
    assert all(least - 0.1 <= apart <= most + 0.1 for apart in passed)
    assert len(passed) > 3


def test_a_conflict_hits_between_a_quarter_and_three_quarters_of_the_egos_width():
    for drive, one in encounters():
        if one.course is not Course.CONFLICT or one.who == "car":
            continue
        x, y, heading = drive.plan.route.pose(one.arrival_m)
        front = x + EGO_LENGTH_M / 2 * np.cos(heading), y + EGO_LENGTH_M / 2 * np.sin(heading)
        hit = np.array(one.walk.pose(one.lead_s)[:2]) - front
        # Along their way: in a turn the ego's front is askew to it.
        way = np.cos(one.walk.heading), np.sin(one.walk.heading)
        assert abs(float(hit @ way)) <= EGO_WIDTH_M / 4 + 0.02


def test_nobody_waits_in_the_egos_way_nor_in_the_way_of_its_sight():
    for drive, one in encounters():
        start = np.array([[*one.walk.start, one.walk.heading]])
        poses = np.array([drive.plan.route.pose(s) for s in np.arange(0.0, drive.goal_m, 0.5)])
        count = len(poses)
        assert not footprints_meet(
            poses,
            np.broadcast_to(CATALOGUE["ego"].size[:2], (count, 2)),
            np.repeat(start, count, axis=0),
            np.broadcast_to(CATALOGUE[one.who].size[:2], (count, 2)),
            np.zeros(count),
        ).any()
        # What stands leaves the lines of sight free, but for who else is met.
        eyes, seen = np.moveaxis(np.array(one.sight.lines), 1, 0)
        for kind, way in zip(drive.kinds, drive.ways, strict=True):
            if (way == way[0]).all():
                assert not hides(tuple(way[0]), CATALOGUE[kind].size[:2], eyes, seen).any(), kind


def test_lanes_lie_on_the_drives_roads_and_hold_somebody():
    for seed in SEEDS:
        for lane in drawn(seed).lanes:
            assert isinstance(lane.curve, Curve)
            assert len(lane.kinds) == len(lane.places) == len(lane.speeds) > 0
            assert list(lane.places) == sorted(lane.places)


@pytest.mark.parametrize(
    ("wanted", "holds"),
    [
        (Wanted(side=1), lambda one: one.side == 1),
        (Wanted(side=-1), lambda one: one.side == -1),
        (Wanted(who="child"), lambda one: one.who == "child"),
        (Wanted(reported=True), lambda one: one.occluder_reported),
        (Wanted(reported=False), lambda one: not one.occluder_reported),
    ],
)
def test_only_what_is_wanted_is_met(wanted, holds):
    met = [
        one
        for seed in SEEDS
        for one in draw_drive(np.random.default_rng(seed), 6.0, wanted).encounters
    ]
    assert len(met) >= 4
    assert all(map(holds, met))


def test_no_more_are_met_than_wanted():
    for most in (0, 1):
        drives = [draw_drive(np.random.default_rng(seed), 6.0, Wanted(most)) for seed in SEEDS]
        assert {len(drive.encounters) for drive in drives} <= set(range(most + 1))


def test_the_ego_turns_off_where_it_always_shall_and_never_where_not():
    plans = [
        [
            len(draw_drive(np.random.default_rng(seed), 6.0, turn_chance=chance).stretches)
            for seed in SEEDS
        ]
        for chance in (0.0, 1.0)
    ]
    assert set(plans[0]) == {1}
    assert 2 in plans[1]
