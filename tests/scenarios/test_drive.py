"""The drive as a world: what an ego meets that drives on by its plan, without a brake."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import streams
from care_sim.scenarios.drive import DriveScenario
from care_sim.sensors.surround import SURROUND_CAMERAS

SEEDS = (2, 3, 16, 46, 95, 137)
"""Of those that hold encounters of every course, turns to both sides and bends."""


class Passage(NamedTuple):
    """What came of a drive: the meetings; per body of one the least clearance after it set off; the
    names of what else was touched; how far the ego came, and its goal.
    """

    meetings: list
    clearances: dict
    touched: set
    along_m: float
    goal_m: float


@cache
def passage(seed):
    """The drive of a seed with an ego that drives on, slowing for bends alone."""
    world = DriveScenario().build(np.random.default_rng(streams((seed,), 5)[0]))
    met = {one.body for one in world.meetings}
    names = {actor.body: actor.name for actor in world.actors}
    clearances, touched = {}, set()
    while world.along_m < world.goal_m and world.time < 59.0:
        speed = world.ego.speed
        planned = world.speed_plan.at(world.along_m + speed * 0.05)
        impact = world.advance(float(np.clip((planned - speed) / 0.05, -2.0, 1.5)), 0.05).impact
        if impact and impact.body not in met:
            touched.add(names[impact.body])
        for one in world.meetings:
            if one.crosser.went:
                near = world.bullet.clearance(world.ego_body, one.body, 9.0)
                clearances[one.body] = min(clearances.get(one.body, 9.0), near)
    world.close()
    return Passage(world.meetings, clearances, touched, world.along_m, world.goal_m)


@pytest.mark.parametrize("seed", SEEDS)
def test_an_ego_that_drives_on_hits_every_conflict_and_nobody_else_who_comes(seed):
    drive = passage(seed)
    for one in drive.meetings:
        if one.crosser.went:
            assert (drive.clearances[one.body] <= 0.0) is (one.course == "conflict")


def test_these_drives_hold_every_course_and_nearly_all_set_off():
    meetings = [one for seed in SEEDS for one in passage(seed).meetings]
    assert {one.course for one in meetings if one.crosser.went} == {"conflict", "near-miss", "stop"}
    hits = {one.way for one in meetings if one.crosser.went and one.course == "conflict"}
    assert hits == {"straight", "bend", "turn"}
    assert np.mean([bool(one.crosser.went) for one in meetings]) > 0.7


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


def test_the_car_has_six_cameras():
    assert DriveScenario.cameras == SURROUND_CAMERAS


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
