"""The drive as a world: what an ego meets that drives on by its plan, without a brake."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import streams
from care_sim.scenarios import drive
from care_sim.scenarios.drive import DriveScenario
from care_sim.streets.drive import draw_drive
from care_sim.world.motions import Crosser
from care_sim.world.world import WORLD_STEP_S

SEEDS = (2, 3, 16, 46, 95, 137)
"""Seeds of drives that hold encounters of every course, turns to both sides and bends."""


class Passage(NamedTuple):
    """The outcome of a drive: the meetings; per body of one the least clearance after it set off;
    the names of other touched bodies; how far the ego came, and its goal; the seconds since each
    who decided should have set off, when it was known.
    """

    meetings: list
    clearances: dict
    touched: set
    along_m: float
    goal_m: float
    late_s: dict


def built(seed, **parameters):
    """The world of a seed, as its environment builds it."""
    return DriveScenario(**parameters).build(np.random.default_rng(streams((seed,), 5)[0]))


@cache
def passage(seed):
    """The drive of a seed with an ego that drives on, slowing for bends alone."""
    world = built(seed)
    met = {one.body for one in world.meetings}
    names = {actor.body: actor.name for actor in world.actors}
    clearances, touched, late_s = {}, set(), {}
    while world.along_m < world.goal_m and world.time < 59.0:
        speed = world.ego.speed
        planned = world.speed_plan.at(world.along_m + speed * 0.05)
        impact = world.advance(float(np.clip((planned - speed) / 0.05, -2.0, 1.5)), 0.05).impact
        if impact and impact.body not in met:
            touched.add(names[impact.body])
        for one in world.meetings:
            if one.crosser.went is not None:
                late_s.setdefault(one.body, world.time - one.crosser.walk.starts_s)
            if one.crosser.went:
                near = world.bullet.clearance(world.ego_body, one.body, 9.0)
                clearances[one.body] = min(clearances.get(one.body, 9.0), near)
    world.close()
    return Passage(world.meetings, clearances, touched, world.along_m, world.goal_m, late_s)


@pytest.mark.parametrize("seed", SEEDS)
def test_an_ego_that_drives_on_hits_every_conflict_and_nobody_else_who_comes(seed):
    drive = passage(seed)
    for one in drive.meetings:
        if one.crosser.went:
            assert (drive.clearances[one.body] <= 0.0) is (one.course == "conflict")


def test_who_comes_decides_within_a_step_of_the_moment():
    late_s = [each for seed in SEEDS for each in passage(seed).late_s.values()]
    assert 0 <= min(late_s) <= max(late_s) <= WORLD_STEP_S + 1e-9


def test_these_drives_hold_every_course_and_nearly_all_set_off():
    meetings = [one for seed in SEEDS for one in passage(seed).meetings]
    assert {one.course for one in meetings if one.crosser.went} == {"conflict", "near-miss", "stop"}
    hits = {one.way for one in meetings if one.crosser.went and one.course == "conflict"}
    assert hits == {"straight", "bend", "turn"}
    assert np.mean([bool(one.crosser.went) for one in meetings]) > 0.7


def drive_on(world):
    """Move a world by a step, with an ego that slows for bends alone."""
    speed = world.ego.speed
    planned = world.speed_plan.at(world.along_m + speed * WORLD_STEP_S)
    world.step(float(np.clip((planned - speed) / WORLD_STEP_S, -2.0, 1.5)))


def driven(world):
    """The vehicles of the traffic."""
    return [actor for actor in world.actors if actor.name.startswith("driven")]


@pytest.mark.parametrize(("seed", "who_is_behind"), [(321, "bus"), (385, "car")])
@pytest.mark.parametrize("into_turn_m", [2.0, 6.0])
def test_who_follows_stops_before_an_ego_that_stands_in_a_turn(seed, who_is_behind, into_turn_m):
    world = built(seed, encounters=0)
    turn_m = world.route.legs[0][0]
    while world.along_m < turn_m + into_turn_m:
        drive_on(world)
    nearest_m = {}
    for _ in range(300):
        world.step(-6.0)
        for one in driven(world):
            clearance = world.bullet.clearance(world.ego_body, one.body, 9.0)
            nearest_m[one] = min(nearest_m.get(one, 9.0), clearance)
    nearest = min(nearest_m, key=nearest_m.get)
    assert nearest.name == f"driven {who_is_behind}"
    assert 0.5 < nearest_m[nearest] < 9.0
    assert np.hypot(*world.velocities_of(np.array([nearest.body]))[0]) < 0.1
    world.close()


@pytest.mark.parametrize("seed", [18, 81])
def test_drivers_stay_clear_of_who_crosses(seed):
    world = built(seed)
    nearest_m = 9.0
    while world.along_m < world.goal_m:
        drive_on(world)
        for meeting in world.meetings:
            if meeting.crosser.went:
                own = world.bullet.clearance
                clearances = [own(meeting.body, one.body, 9.0) for one in driven(world)]
                nearest_m = min(nearest_m, *clearances)
    # Drivers who do not brake come within 1.8 and 1.2 m.
    assert 2.0 < nearest_m < 9.0
    world.close()


def test_nobody_sets_off_into_the_way_of_a_driver_who_is_about_to_stop_there():
    world = built(252)
    while world.along_m < world.goal_m:
        drive_on(world)
    assert [one.crosser.went for one in world.meetings if one.who == "car"] == [False]
    world.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_who_stops_before_the_lanes_is_in_none_and_who_crosses_leaves_them(seed):
    drawn = draw_drive(np.random.default_rng(streams((seed,), 5)[0]), 60.0)
    for one in drawn.encounters:
        for lane in drawn.lanes:
            if lane.curve == one.curve:
                crossing = drive._crossing(Crosser(one.walk, 1.0, bool), one, lane)
                in_none = one.walk.length_m < crossing.from_m
                assert in_none is (one.course == "stop")
                assert in_none or 0.0 < crossing.from_m < crossing.to_m < one.walk.length_m


@pytest.mark.parametrize("seed", [18, 81])
def test_who_crosses_goes_as_if_nobody_drove_there(seed, monkeypatch):
    world = built(seed)
    monkeypatch.setattr(drive, "_add_vehicles", lambda *_: None)
    alone = built(seed)
    while world.along_m < world.goal_m:
        drive_on(world)
        drive_on(alone)
        for one, other in zip(world.meetings, alone.meetings, strict=True):
            assert one.crosser.pose(world.time) == other.crosser.pose(alone.time)
    assert all(one.crosser.went for one in world.meetings)
    world.close()
    alone.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_stands_or_walks_in_the_way_but_traffic(seed):
    drive = passage(seed)
    assert drive.along_m >= drive.goal_m
    assert all(name.startswith("driven") for name in drive.touched)


def test_the_episode_is_about_the_first_conflict():
    worlds = [
        DriveScenario(duration_s=1.0).build(np.random.default_rng(seed)) for seed in (1, 8, 9, 11)
    ]
    for world in worlds:
        conflicts = [one for one in world.meetings if one.course == "conflict"]
        first = (conflicts or world.meetings or [None])[0]
        sought = world.first_sighting
        assert (sought and sought.body) == (first and first.body)
        world.close()
    assert [len(world.meetings) for world in worlds] == [3, 1, 2, 0]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"side": "both"}, "side of drive 'both'"),
        ({"who": "bus"}, "who of drive 'bus'"),
        ({"occluder_reported": "no"}, "occluder_reported of drive must be"),
        ({"who": "car", "occluder_reported": True}, "who of drive must be one of child"),
        ({"encounters": 4}, "encounters of drive must be"),
    ],
)
def test_whom_a_drive_does_not_know_is_refused(arguments, told):
    with pytest.raises(InvalidInput, match=told):
        DriveScenario(**arguments)
