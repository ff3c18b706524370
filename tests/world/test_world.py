import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.world.motions import Walk
from care_sim.world.traffic import Traffic
from care_sim.world.world import WORLD_STEP_S, World, whole_steps


@pytest.fixture
def world():
    made = World(Traffic((1, -1), 0, 3.5, 14.0), ego_speed=10.0)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("duration", "steps"), [(0.05, 1), (0.1, 2), (0.3, 6), (0.5, 10), (6.0, 120)]
)
def test_whole_steps(duration, steps):
    assert whole_steps(duration) == steps


@pytest.mark.parametrize("duration", [0.07, 0.12, 0.026, 0.0, -0.1, 0.01, 1 / 3])
def test_a_period_that_does_not_divide_is_refused(duration):
    with pytest.raises(InvalidInput, match=r"keyframe_s must be a multiple .* 0\.05"):
        whole_steps(duration)


def test_time_and_ego_advance_together(world):
    for _ in range(10):
        world.advance(0.0, 0.1)
    assert world.time == pytest.approx(1.0)
    assert world.ego.pose == pytest.approx((10.0, 0.0, 0.0))
    assert (world.ego_motion.speed, world.ego_motion.acceleration) == pytest.approx((10.0, 0.0))


def test_odometry_reports_what_braking_really_does(world):
    world.advance(-5.0, 0.1)
    assert (world.ego_motion.speed, world.ego_motion.acceleration) == pytest.approx((9.5, -5.0))
    world.advance(-5.0, 3.0)
    assert (world.ego_motion.speed, world.ego_motion.acceleration) == pytest.approx((0.0, 0.0))


def test_a_collision_is_told_with_the_speed_of_the_first_contact(world):
    """The bus stands 7 m before the bumper; braking at 5 m/s^2 from 10 m/s leaves sqrt(30) m/s
    there.
    """
    world.add("bus", "bus", (2.04 + 7.0 + 11.19 / 2, 0.0, 0.0))
    passage = world.advance(-5.0, 1.5)
    assert passage.impact_speed_mps == pytest.approx(np.sqrt(30), abs=0.25)


def test_passing_close_by_is_no_collision(world):
    bus = world.add("bus", "bus", (10.0, 0.865 + 0.05 + 1.47, 0.0))
    world.first_sighting = bus
    passage = world.advance(0.0, 2.0)
    assert passage.impact_speed_mps is None
    assert passage.clearance_m == pytest.approx(0.05, abs=5e-3)
    assert passage.nearest_m == pytest.approx(0.865 + 0.05 + 1.47, abs=0.05)


def test_any_body_counts_for_the_collision_but_only_the_first_sighting_for_clearance(world):
    world.add("hoarding", "hoarding", (8.0, 0.0, np.pi / 2))
    world.first_sighting = world.add("person", "pedestrian", (0.0, 20.0, 0.0))
    passage = world.advance(0.0, 1.0)
    assert passage.impact_speed_mps == pytest.approx(10.0)
    assert passage.clearance_m > 15


def test_a_contact_between_the_ends_of_a_keyframe_is_not_missed():
    """A person who crosses just ahead of the bumper while the car passes."""
    world = World(Traffic((1, -1), 0, 3.5, 14.0), ego_speed=10.0)
    walk = Walk((4.0, 0.0), np.pi / 2, 3.0, 100.0, 50.0)
    world.first_sighting = world.add("person", "pedestrian", walk.pose)
    passages = [world.advance(0.0, 1.0)]
    assert passages[0].impact_speed_mps == pytest.approx(10.0)
    world.close()


def test_actors_follow_their_functions_in_picture_and_truth(world):
    walk = Walk((20.0, -5.0), np.pi / 2, 2.0, 100.0, 50.0, 0.5)
    person = world.add("person", "pedestrian", walk.pose)
    world.advance(0.0, 1.5)
    assert world.boxes([person])[0] == pytest.approx(
        [20, -5 + 1.98, 0.88, 0.73, 0.66, 1.76, np.pi / 2]
    )
    ranges, ids = world.bullet.cast([20.0, -20.0, 1.0], np.array([[0.0, 1.0, 0.0]]), 30.0)
    assert ids.tolist() == [person.body]
    assert ranges[0] == pytest.approx(20 - 5 + 1.98 - 0.6 * 0.73 / 2, abs=1e-3)


def test_events_happen_once_at_their_step(world):
    happened = []
    world.at(0.12, lambda: happened.append(world.time))
    world.at(0.3, lambda: happened.append(world.time))
    world.advance(0.0, 0.1)
    assert happened == []
    world.advance(0.0, 0.4)
    assert happened == pytest.approx([0.15, 0.3])
    assert WORLD_STEP_S == 0.05


def test_an_event_may_start_one_that_is_due_already(world):
    happened = []
    world.at(0.1, lambda: world.at(0.0, lambda: happened.append(world.time)))
    world.advance(0.0, 0.3)
    assert happened == pytest.approx([0.15])


def test_labels_are_for_reported_bodies_of_the_five_classes(world):
    car = world.add("a", "car", (10.0, 5.0, 0.0))
    silent = world.add("b", "car", (20.0, 5.0, 0.0), reported=False)
    trailer = world.add("c", "trailer", (30.0, 5.0, 0.0))
    assert (car.label, silent.label, trailer.label) == (CLASSES.index("car"), None, None)


def test_a_driver_of_the_traffic_is_a_body_too(world):
    driver = world.traffic.add_driver(30.0, 1, 8.0, world.ego_kind)
    actor = world.add("oncoming", "car", driver)
    world.advance(0.0, 1.0)
    x, y, *_ = world.boxes([actor])[0]
    assert (x, y) == pytest.approx((22.0, 3.5), abs=0.1)


def test_what_comes_later_is_at_once_where_it_belongs(world):
    """Its box, and the hulls that collide."""
    world.at(0.1, lambda: world.add("late", "bus", lambda time: (100.0 - 700 * time, 0.0, 0.0)))
    assert world.advance(0.0, 0.05).impact_speed_mps is None
    world.advance(0.0, 0.05)
    (late,) = world.actors
    assert world.boxes([late])[0, 0] == pytest.approx(30.0)
    assert world.bullet.cast(np.array([0.0, 0.0, 1.0]), np.array([[1.0, 0.0, 0.0]]), 50.0)[
        0
    ] == pytest.approx(30.0 - late.kind.size[0] / 2, abs=0.01)


def test_an_unknown_kind_of_body_is_named(world):
    with pytest.raises(InvalidInput, match=r"unknown kind of body 'dragon'; known: .*pedestrian"):
        world.add("somebody", "dragon", (10.0, 0.0, 0.0))


def test_an_episode_goes_on_until_the_ego_arrives_unless_its_scenario_ends_it_otherwise(world):
    assert not world.is_over()
    world.goal_m = 3.0
    world.advance(0.0, 0.25)
    assert not world.is_over()
    world.advance(0.0, 0.05)
    assert world.is_over()
    world.ended = lambda now: now.time > 0.4
    assert not world.is_over()
    world.advance(0.0, 0.15)
    assert world.is_over()


def test_what_is_called_at_every_step_is_handed_the_world_of_that_time(world):
    seen = []
    world.at_every_step(lambda now: seen.append((now is world, now.time, now.along_m)))
    world.advance(0.0, 0.1)
    assert seen == [(True, 0.05, pytest.approx(0.5)), (True, 0.1, pytest.approx(1.0))]


def test_clearances_are_those_of_the_bodies_in_its_own_client(world):
    world.add("trailer", "trailer", (20.0, -3.2, 0.1))
    walk = Walk((25.0, -3.0), np.pi / 2, speed=2.7, acceleration=5.0, length_m=8.0)
    person = world.first_sighting = world.add("person", "pedestrian", walk.pose)
    clearances = []
    for _ in range(60):
        clearances.append(world.advance(0.0, WORLD_STEP_S).clearance_m)
        assert clearances[-1] == world.bullet.clearance(world.ego_body, person.body)
    assert min(clearances) < 5.0 < max(clearances)


@pytest.mark.parametrize("lost", [(np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), (0.0, 0.0, np.nan)])
def test_an_actor_that_gets_lost_is_named_with_its_place_and_the_time(world, lost):
    world.scene = "scenario mine:Fog"
    world.add("ghost", "car", lambda time: (30.0, 3.0, 0.0) if time < 0.2 else lost)
    place = ", ".join(f"{number:g}" for number in lost)
    told = f"scenario mine:Fog: the pose of ghost is {place} at 0.2 s; x, y and heading must be"
    world.advance(0.0, 0.15)
    with pytest.raises(InvalidInput, match=told):
        world.advance(0.0, 0.15)


def test_a_body_is_not_added_anywhere(world):
    with pytest.raises(InvalidInput, match="the pose of wall is nan, 0, 0 at 0 s"):
        world.add("wall", "terrace", (np.nan, 0.0, 0.0))


def test_an_ego_that_gets_lost_is_named(world):
    with pytest.raises(InvalidInput, match="the pose of the ego is nan, "):
        world.advance(np.nan, 0.2)
