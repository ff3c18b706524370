import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.world.bullet import BulletWorld
from care_sim.world.motions import LinearMotion, rates_between

STILL = np.zeros(3)
rates = st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(-2, 2)).map(np.array)
instants = st.floats(-0.1, 0)


def moving(ego_rates, body_rates=()):
    return LinearMotion((3.0, -2.0, 0.5), ego_rates, np.array([STILL, *body_rates]))


def test_rates_lead_from_one_pose_to_the_other_the_shorter_way_round():
    before = np.array([[0.0, 0.0, 3.1], [1.0, 1.0, 0.2]])
    after = np.array([[1.0, -2.0, -3.1], [1.0, 1.0, 0.1]])
    expected = [[2.0, -4.0, 2 * (2 * np.pi - 6.2)], [0.0, 0.0, -0.2]]
    assert rates_between(before, after, 0.5) == pytest.approx(np.array(expected))


@given(rates, instants)
def test_bodies_are_where_their_rates_lead_them(body_rates, seconds):
    world = BulletWorld(ground=False)
    pose = np.array([5.0, 1.0, 0.7])
    world.primitives.poses = np.zeros((2, 7))
    world.move_all(np.array([1]), pose[None])
    moved = moving(STILL, [body_rates]).poses(world.primitives.poses, seconds)
    world.move_all(np.array([1]), (pose + body_rates * seconds)[None])
    expected = world.primitives.poses[1]
    world.close()
    # A turn and its opposite quaternion are one turn.
    sign = np.sign(moved[1, 3:] @ expected[3:])
    assert moved[1, :3] == pytest.approx(expected[:3])
    assert moved[1, 3:] * sign == pytest.approx(expected[3:])


@given(rates, instants)
def test_the_sensor_stays_where_it_is_mounted_on_the_ego(ego_rates, seconds):
    at = (-0.445, 0.2, 1.84)
    motion = moving(ego_rates)
    later = tuple(np.array(motion.ego) + ego_rates * seconds)
    sensor = motion.sensor(Frame.mounted(motion.ego, at), seconds)
    expected = Frame.mounted(later, at)
    assert sensor.origin == pytest.approx(expected.origin)
    assert sensor.yaw == pytest.approx(expected.yaw)


@given(rates, instants)
def test_compensated_points_lie_where_they_were_in_the_world(ego_rates, seconds):
    motion = moving(ego_rates)
    sensor = Frame(2.6, -2.1, 1.84, 0.5, 0.02, -0.03)
    then = motion.sensor(sensor, seconds)
    points = np.array([[10.0, 3.0, -1.0], [-4.0, 0.0, 2.0]])
    world = then.origin + then.vectors_to_world(points)
    found = motion.compensated(points, sensor, np.full(2, seconds))
    assert sensor.origin + sensor.vectors_to_world(found) == pytest.approx(world)
