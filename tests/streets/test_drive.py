"""The parts of a drive that are drawn."""

from functools import cache

import numpy as np
import pytest

from care_sim.streets.draft import footprints_meet
from care_sim.streets.drive import LENGTH_M, draw_drive
from care_sim.streets.encounters import Wanted
from care_sim.streets.sight import hides
from care_sim.world.bodies import CATALOGUE

SEEDS = (0, 2, 9, 12, 18, 19, 24, 25)
"""Straight, bent and turning off to both sides, with up to three to meet."""

MANY = (2, 7, 9, 12, 19, 27, 28, 42)
"""With every course on straights, in bends and in turns to both sides."""


@cache
def drawn(seed):
    return draw_drive(np.random.default_rng(seed), 6.0)


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
        # Standing bodies leave the lines of sight free, but for others who are met.
        eyes, seen = np.moveaxis(np.array(one.sight.lines), 1, 0)
        for kind, way in zip(drive.kinds, drive.ways, strict=True):
            if (way == way[0]).all():
                assert not hides(tuple(way[0]), CATALOGUE[kind].size[:2], eyes, seen).any(), kind


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
