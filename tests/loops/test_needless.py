"""Braking for nothing, told from the truth."""

import numpy as np
import pytest

from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import Tracks
from care_sim.driving.corridor import enters_strip
from care_sim.loops.needless import NeedlessBraking, UnfoundedBraking, in_the_way
from care_sim.world.route import Route
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

RULES = DriverSettings()
STRIP = 1.1, 0.87 + 0.3, RULES.brake_horizon_s


@pytest.fixture
def world():
    traffic = Traffic((1,), ego_lane=0, lane_width=3.5, speed_limit=20.0)
    route = Route(legs=((12.0, 0.0), (15.0, 0.1), (50.0, 0.0)))
    made = World(traffic, 8.0, route)
    yield made
    made.close()


def judged(world, judge, braking=True):
    return judge.judge(world.time, braking, len(entering(world)) > 0)


def entering(world):
    """The bodies in the way."""
    sensor = Frame.mounted(world.ego.pose, LIDAR_POSITION)
    return in_the_way(world, sensor, *STRIP)


def fresh():
    return NeedlessBraking(RULES.brake_release_s)


def test_an_empty_way_needs_no_brake(world):
    world.add("beside", "car", (10.0, -3.0, 0.0))
    world.add("behind", "car", (-12.0, 0.0, 0.0))
    assert judged(world, fresh())
    assert not judged(world, fresh(), braking=False)


@pytest.mark.parametrize("kind", ["pedestrian", "hedge"])
def test_what_stands_in_the_way_does_whether_it_is_reported_or_not(world, kind):
    world.add("in the way", kind, (10.0, 0.5, 0.0))
    assert not judged(world, fresh())


def test_the_way_is_that_of_the_route(world):
    """Straight on is beside the way, round the bend is in it."""
    world.add("straight on", "car", (34.0, 0.0, 0.0))
    assert judged(world, fresh())
    x, y, heading = world.route.pose(30.0)
    world.add("round the bend", "car", (x, y, heading))
    assert not judged(world, fresh())


@pytest.mark.parametrize(("speed", "needless"), [(2.0, False), (0.5, True), (-2.0, True)])
def test_who_will_be_in_the_way_within_the_horizon_counts(world, speed, needless):
    world.add("runner", "pedestrian", lambda time: (14.0, -4.0 + speed * time, np.pi / 2))
    world.advance(0.0, 0.1)
    assert judged(world, fresh()) is needless


def test_the_wait_before_the_brake_is_released_does_not_count(world):
    judge = fresh()
    leaves = world.add("leaves", "car", lambda time: (10.0, 0.0 if time < 0.2 else 9.0, 0.0))
    assert not judged(world, judge)
    answers = []
    for _ in range(10):
        world.advance(-5.0, 0.1)
        answers.append(judged(world, judge))
    assert leaves.pose_at(world.time)[1] == 9.0
    # It is gone from 0.2 s on, was last needed at 0.1 s, and the wait is half a second.
    assert answers == [False] * 6 + [True] * 4


def unfounded(world, box, in_view=False, behind=()):
    """Whether the brake is, with a track of a standing car at this x, y of the sensor's frame."""
    sensor = Frame.mounted(world.ego.pose, LIDAR_POSITION)
    track = Tracks(
        np.array([1]),
        np.array([0]),
        np.array([[*box, -1.0, 4.6, 1.9, 1.5, 0.0]]),
        np.zeros((1, 2)),
        np.array([0]),
        np.array([3]),
    )
    boxes = sensor.boxes_to_world(track.boxes[enters_strip(track, *STRIP)])
    judge = UnfoundedBraking(RULES.brake_release_s)
    return judge.judge_tracks(world, boxes, entering(world), True, in_view, np.array(behind))


def test_a_track_in_the_way_without_a_body_is_made_up(world):
    world.add("aside", "car", (10.0, 5.0, 0.0))
    assert unfounded(world, (12.0, 0.0))


def test_a_body_whose_place_is_misjudged_is_not_made_up(world):
    """The car stands 2.2 m aside, out of the way, and its track reaches into the way."""
    world.add("aside", "car", (12.0, 2.2, 0.0))
    assert judged(world, fresh())
    assert not unfounded(world, (12.0, 1.8))


def test_a_body_that_nobody_has_seen_is_no_reason(world):
    hidden = world.add("hidden", "child", (10.0, 0.0, 0.0))
    assert not unfounded(world, (10.0, 0.0))
    world.first_sighting = hidden
    assert unfounded(world, (10.0, 0.0))
    assert not unfounded(world, (10.0, 0.0), in_view=True)
    assert not unfounded(world, (10.0, 0.0), behind=[hidden.body])
