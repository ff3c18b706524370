"""The closed loop on small worlds made by hand: when it reads truth, and what its sensing does."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.one_world import OneWorld
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE
from care_sim.world.route import Route, SpeedPlan
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

SPEED = 10.0
RIG = Rig(cameras=(FRONT_CAMERA,))
EVERYTHING = np.arange(RIG.grid.size)
NOTHING = np.array([], dtype=np.int64)
BUMPER = CATALOGUE["ego"].size[0] / 2
BUS = CATALOGUE["bus"].size[0] / 2


@pytest.fixture
def street():
    """Makes worlds of one lane, the ego driving at SPEED."""
    made = []

    def make(route=None):
        made.append(World(Traffic((1,), 0, 3.5, 14.0), SPEED, route))
        return made[-1]

    yield make
    for world in made:
        world.close()


@pytest.fixture
def row_of_cars(street):
    """Makes the same world again and again: six cars abreast, all in view and none in the way."""

    def make():
        world = street()
        for n in range(6):
            world.add(f"car {n}", "car", (25.0, 6.0 * n - 15.0, 0.0))
        return world

    return make


def loop_in(world, seeds=(0, 1, 2), **conditions):
    return OneWorld.begun(
        world,
        RIG,
        ClosedLoopConditions(**conditions),
        SensorSeeds(*(np.random.SeedSequence(seed) for seed in (*seeds, 3))),
        10.0,
    )


def cells_on(loop, actor):
    return RIG.grid.hulls(loop.sensor.boxes_to_local(loop.world.boxes([actor])), 0, 0)[0]


def test_a_keyframe_tells_time_speed_and_distance_at_its_scan(street):
    """The bus makes the car brake, 0.3 s later at 5 m/s^2."""
    world = street()
    world.first_sighting = world.add("bus", "bus", (BUMPER + 12.0 + BUS, 0.0, 0.0))
    loop = loop_in(world)
    frames, travelled = [], []
    for _ in range(6):
        travelled.append(loop.world.ego.pose[0])
        frames.append(loop.keyframe(EVERYTHING))
    ahead = BUMPER + 12.0 + BUS - LIDAR_POSITION[0]
    assert [frame.index for frame in frames] == list(range(6))
    assert all(frame.braking for frame in frames)
    assert [frame.time_s for frame in frames] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert [frame.speed_mps for frame in frames] == pytest.approx(
        [10.0, 10.0, 10.0, 10.0, 9.5, 9.0]
    )
    assert [frame.distance_m for frame in frames] == pytest.approx([ahead - x for x in travelled])
    assert [frame.nearest_m for frame in frames[:3]] == pytest.approx(
        [frame.distance_m + LIDAR_POSITION[0] for frame in frames[1:4]]
    )


def test_the_distance_is_from_the_sensor_of_a_car_that_has_turned_off(street):
    world = street(Route(legs=((2.0, 0.0), (15.0, 0.1), (300.0, 0.0))))
    world.first_sighting = world.add("person", "pedestrian", (30.0, 4.0, 0.0))
    loop = loop_in(world)
    for _ in range(12):
        sensor = Frame.mounted(world.ego.pose, LIDAR_POSITION)
        assert loop.keyframe(NOTHING).distance_m == pytest.approx(
            np.hypot(30.0 - sensor.x, 4.0 - sensor.y)
        )
    assert sensor.y > 1.0


def test_the_next_belief_forecasts_a_moving_body_where_the_sensor_then_is(street):
    world = street()
    start, velocity = np.array([20.0, 6.0]), np.array([-3.0, 4.0])
    world.add("car", "car", lambda time: (*(start + velocity * time), 0.0))
    loop = loop_in(world)
    assert len(loop.belief.tracks) == 0
    loop.keyframe(EVERYTHING)
    once = loop.belief.tracks
    loop.keyframe(EVERYTHING)
    twice = loop.belief.tracks

    sensor = np.array([SPEED * 0.1 + LIDAR_POSITION[0], 0.0])
    assert once.hits.tolist() == [1]
    assert once.boxes[0, :2] == pytest.approx(start - sensor)
    sensor[0] += SPEED * 0.1
    assert twice.hits.tolist() == [2]
    assert twice.velocities[0] == pytest.approx(velocity)
    assert twice.boxes[0, :2] == pytest.approx(start + velocity * 0.2 - sensor)


@pytest.mark.parametrize(("keyframes", "mps"), [(2, 1.5), (3, 1.0)])
def test_a_velocity_is_of_as_many_keyframes_as_are_asked_for(street, keyframes, mps):
    """A car that gains 10 m/s^2 is 0, 5 and 20 cm on its way: 0.15 m a keyframe, or 0.1 m."""
    world = street()
    world.add("car", "car", lambda time: (20.0, 6.0 + 5 * time**2, 0.0))
    loop = loop_in(world, velocity_keyframes=keyframes)
    for _ in range(3):
        loop.keyframe(EVERYTHING)
    assert loop.belief.tracks.velocities[0] == pytest.approx([0, mps])


@pytest.mark.parametrize(("x", "in_view"), [(12.0, True), (20.0, False)])
def test_the_first_sighting_is_in_view_before_a_hoarding_and_not_behind_it(street, x, in_view):
    world = street()
    world.add("hoarding", "hoarding", (16.0, 0.0, np.pi / 2))
    world.first_sighting = world.add("person", "pedestrian", (x, 0.0, 0.0))
    frame = loop_in(world).keyframe(EVERYTHING)
    assert (frame.in_view, frame.detected) == (in_view, in_view)


def test_in_view_is_what_the_camera_saw_before_the_scan(street):
    """The person steps out from behind the hoarding while the world moves on."""
    world = street()
    world.add("hoarding", "hoarding", (16.0, 0.0, np.pi / 2))
    world.first_sighting = world.add(
        "person", "pedestrian", lambda time: (20.0 if time < 0.15 else 12.0, 0.0, 0.0)
    )
    loop = loop_in(world)
    assert [loop.keyframe(NOTHING).in_view for _ in range(3)] == [False, False, True]


def test_only_the_first_sighting_counts_as_detected(street):
    world = street()
    car = world.add("car", "car", (14.0, 5.0, 0.0))
    person = world.first_sighting = world.add("person", "pedestrian", (14.0, -5.0, 0.0))
    loop = loop_in(world)
    fired = [cells_on(loop, car), NOTHING, cells_on(loop, person)]
    frames, classes = [], []
    for cells in fired:
        frames.append(loop.keyframe(cells))
        classes.append(loop.belief.tracks.classes[loop.belief.tracks.misses == 0].tolist())
    assert classes == [[CLASSES.index("car")], [], [CLASSES.index("pedestrian")]]
    assert [frame.detected for frame in frames] == [False, False, True]
    for frame, cells in zip(frames, fired, strict=True):
        np.testing.assert_array_equal(frame.fired, cells)


@pytest.mark.parametrize(("latency_s", "age_s"), [(0.05, 0.05), (0.12, 0.15), (0.3, 0.3)])
def test_a_latency_in_seconds_shows_the_picture_of_that_instant(street, latency_s, age_s):
    """It is rounded up to the world's steps of 0.05 s."""
    world = street()
    person = world.add("person", "pedestrian", lambda time: (20.0, 3.0 - 2.0 * time, 0.0))
    expected = {}

    # At every step of the world, what the camera would show there and then.
    def note(_=None):
        sensor = Frame.mounted(world.ego.pose, LIDAR_POSITION)
        x, y = world.actors[0].pose_at(world.time)[:2]
        box = np.array([[x, y, 0.88, *person.kind.size, 0.0]])
        expected[world.time] = FRONT_CAMERA.project_boxes(sensor.boxes_to_local(box))[0]

    note()
    world.at_every_step(note)
    loop = loop_in(world, camera_latency_s=latency_s)
    for _ in range(8):
        loop.keyframe(NOTHING)
        detections = loop.belief.detections
        taken = round(world.time - age_s, 9)
        assert len(detections) == (taken >= 0)
        if taken >= 0:
            assert detections.ages.tolist() == pytest.approx([age_s])
            assert detections.boxes[0] == pytest.approx(expected[taken], abs=1.5)


def test_a_picture_between_keyframes_leaves_the_world_as_it_is(row_of_cars):
    """The same keyframes come of it, hits included."""

    def played(latency_s):
        world = row_of_cars()
        world.first_sighting = world.add("wall", "wall", (6.0, 0.0, 1.57))
        loop = loop_in(world, camera_latency_s=latency_s)
        return [vars(loop.keyframe(NOTHING)) for _ in range(6)]

    ours, theirs = played(0.05), played(0.0)
    assert any(record["impact"] for record in ours)
    for our, their in zip(ours, theirs, strict=True):
        np.testing.assert_equal(our, their)


def misses_and_losses(world, seeds):
    """The camera's detections and the scans of three keyframes with faults of both sensors."""
    loop = loop_in(world, seeds, false_negative_rate=0.5, lidar_dropout=0.5)
    detections, scans = [loop.belief.detections.rows().tolist()], []
    for _ in range(3):
        loop.keyframe(EVERYTHING)
        detections.append(loop.belief.detections.rows().tolist())
        scans.append(loop.belief.ranges.tolist())
    return detections, scans


def test_the_camera_misses_and_the_lidar_loses_each_by_its_own_seed(row_of_cars):
    misses, losses = misses_and_losses(row_of_cars(), (7, 8, 9))
    assert misses_and_losses(row_of_cars(), (7, 8, 9)) == (misses, losses)
    other_misses, same_losses = misses_and_losses(row_of_cars(), (9, 8, 9))
    same_misses, other_losses = misses_and_losses(row_of_cars(), (7, 9, 9))
    assert misses == same_misses != other_misses
    assert losses == same_losses
    assert all(one != other for one, other in zip(losses, other_losses, strict=True))
    assert losses[0] != losses[1]


def test_what_the_sensors_lose_stays_in_view_for_the_scoring(row_of_cars):
    world = row_of_cars()
    world.first_sighting = world.actors[0]
    loop = loop_in(world, false_negative_rate=1.0, lidar_dropout=1.0)
    frame = loop.keyframe(EVERYTHING)
    assert (frame.in_view, frame.detected) == (True, False)
    assert (len(loop.belief.detections), len(loop.belief.tracks)) == (0, 0)
    assert np.all(loop.belief.ranges == RIG.grid.range_m)


def test_the_belief_shows_the_scan_in_its_cells_and_zero_elsewhere(row_of_cars):
    world = row_of_cars()
    loop = loop_in(world)
    assert not loop.belief.ranges.any()
    cells = cells_on(loop, world.actors[0])
    loop.keyframe(cells)
    np.testing.assert_array_equal(np.flatnonzero(loop.belief.ranges), cells)


def test_a_detector_that_asks_for_too_many_returns_stays_silent_and_the_car_drives_on(street):
    world = street()
    world.first_sighting = world.add("bus", "bus", (BUMPER + 12.0 + BUS, 0.0, 0.0))
    loop = loop_in(world, min_returns=10**6)
    frame = loop.keyframe(EVERYTHING)
    assert (frame.detected, frame.braking, len(loop.belief.tracks)) == (False, False, 0)


def test_a_collision_is_told_at_its_keyframe_with_the_speed_of_the_contact(street):
    """Braking from 0.3 s on covers 3.65 m by 0.70 s, and 4.05 m by 0.75 s with 7.75 m/s left."""
    world = street()
    world.add("bus", "bus", (BUMPER + 3.0 + 3.85 + BUS, 0.0, 0.0))
    loop = loop_in(world)
    impacts = [loop.keyframe(EVERYTHING).impact_speed_mps for _ in range(8)]
    assert impacts[:7] == [None] * 7
    assert impacts[7] == pytest.approx(7.75)


def test_the_guarded_strip_is_that_of_the_driver(street):
    width = CATALOGUE["ego"].size[1]
    wide = loop_in(street(), brake_side_margin_m=1.0)
    human = loop_in(street(), driver="careful-human")
    assert (wide.guarded_m, human.guarded_m) == (pytest.approx(width + 2.0), width)


def test_comfort_is_that_of_the_drive_too(street):
    """A car that drives by a plan and is slower than it gains speed as its settings say."""
    comfort = 0.8
    world = street(Route(legs=((300.0, 0.0),)))
    world.speed_plan = SpeedPlan(world.route, 2 * SPEED, 2.0, 1.5)
    loop = loop_in(world, comfort_mps2=comfort)
    world.ego.speed = SPEED / 2
    # The odometer tells the new speed at the second keyframe.
    loop.keyframe(NOTHING)
    before = world.ego.speed
    loop.keyframe(NOTHING)
    assert world.ego.speed - before == pytest.approx(0.1 * comfort)


def test_a_keyframe_past_the_end_of_an_episode_is_refused(street):
    """Compiled code would write past the ends of its tables."""
    seeds = SensorSeeds(*(np.random.SeedSequence(seed) for seed in range(4)))
    loop = OneWorld.begun(street(), RIG, ClosedLoopConditions(), seeds, 0.2)
    for _ in range(2):
        loop.keyframe(NOTHING)
    with pytest.raises(InvalidInput, match=r"the episode lasts 0\.2 s"):
        loop.keyframe(NOTHING)


def test_a_world_with_its_own_step_and_end_uses_them():
    class Own(World):
        steps = 0

        def step(self, acceleration):
            self.steps += 1
            super().step(acceleration)

        def is_over(self):
            return self.steps == 2

    with closing(Own(Traffic((1,), 0, 3.5, 14.0), SPEED)) as world:
        loop = loop_in(world)
        loop.keyframe(NOTHING)
        assert world.steps == 2
        assert loop._loop.motion.are_over(np.ones(1, np.bool_))


def test_a_world_with_its_own_advance_is_refused():
    class Own(World):
        def advance(self, acceleration, duration):
            return super().advance(acceleration, duration)

    with (
        closing(Own(Traffic((1,), 0, 3.5, 14.0), SPEED)) as world,
        pytest.raises(InvalidInput, match="replace `step`"),
    ):
        loop_in(world)


def test_events_and_the_first_sighting_are_set_when_a_world_is_built(street):
    world = street()
    loop_in(world)
    for add in (lambda: world.at(0.1, print), lambda: world.at_every_step(print)):
        with pytest.raises(InvalidInput, match="events must be set when"):
            add()
    world = street()
    car = world.add("car", "car", (25.0, 0.0, 0.0))
    world.at(0.1, lambda: setattr(world, "first_sighting", car))
    loop = loop_in(world)
    with pytest.raises(InvalidInput, match=r"first_sighting changed by 0\.1 s"):
        loop.keyframe(NOTHING)
