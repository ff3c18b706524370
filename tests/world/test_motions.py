"""How bodies move that no traffic moves."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.world.bullet import BulletWorld
from care_sim.world.motions import Crosser, LaneChange, LinearMotion, Walk, rates_between

RUN = Walk(
    start=(10.0, -4.0), heading=np.pi / 2, speed=2.5, acceleration=5.0, length_m=8.0, starts_s=1.0
)
walks = st.builds(
    Walk,
    start=st.just((0.0, 0.0)),
    heading=st.floats(-3, 3),
    speed=st.floats(0.5, 5),
    acceleration=st.floats(0.5, 8),
    length_m=st.just(1e9),
    starts_s=st.floats(-3, 3),
)


@pytest.mark.parametrize(
    ("time", "covered"),
    [(0.0, 0.0), (1.0, 0.0), (1.2, 0.1), (1.5, 0.625), (2.5, 3.125), (4.45, 8.0), (60.0, 8.0)],
)
def test_covered_distance_worked_by_hand(time, covered):
    """Full speed after half a second and 0.625 m."""
    assert RUN.covered(time) == pytest.approx(covered)


@given(walks, st.floats(0, 50))
def test_a_duration_is_when_the_distance_is_covered(walk, distance):
    assert walk.covered(walk.starts_s + walk.duration_to(distance)) == pytest.approx(
        distance, abs=1e-6
    )


@given(walks, st.floats(0, 10))
def test_distance_is_the_integral_of_a_speed_that_never_exceeds_the_limit(walk, until):
    times = walk.starts_s + np.linspace(0, until, 2001)
    speeds = np.minimum(walk.acceleration * (times - walk.starts_s), walk.speed)
    assert walk.covered(times[-1]) == pytest.approx(np.trapezoid(speeds, times), abs=1e-3)


@given(walks, st.lists(st.floats(-5, 50), max_size=50), st.floats(0.1, 60))
def test_all_poses_at_once_are_those_one_by_one(walk, times, length):
    walk = replace(walk, length_m=length)
    each = np.array([walk.pose(time) for time in times]).reshape(-1, 3)
    assert walk.poses(np.array(times)).tobytes() == each.tobytes()


def test_the_squares_of_a_long_run_up_are_pythons():
    """One in a thousand would be rounded otherwise by NumPy."""
    run_up = replace(RUN, acceleration=0.25, length_m=100.0)
    times = np.linspace(1.0, 11.0, 10001)
    each = np.array([run_up.pose(time) for time in times.tolist()])
    assert run_up.poses(times).tobytes() == each.tobytes()


WALK = Walk((20.0, -4.0), 1.5707963267948966, 2.0, 100.0, 6.0)


def crosser(may_go=lambda _walk: True, lead_s=2.0):
    return Crosser(WALK, lead_s, may_go)


def test_it_waits_until_the_ego_is_near():
    one = crosser()
    one.look(1.0, lambda: 2.4)
    assert one.went is None
    assert one.pose(9.0) == (20.0, -4.0, WALK.heading)


def test_it_set_off_at_the_very_time_between_two_steps():
    one = crosser()
    one.look(5.0, lambda: 1.97)
    assert one.went
    assert one.walk.starts_s == pytest.approx(4.97)
    assert one.pose(6.97)[1] == pytest.approx(-4.0 + 2.0 * 2.0, abs=0.03)


def test_it_decides_once():
    one = crosser()
    asked = []
    for time, left in ((4.0, 2.9), (5.0, 1.9), (7.0, 0.5)):
        one.look(time, lambda left=left: asked.append(left) or left)
    assert one.walk.starts_s == pytest.approx(4.9)
    # A walker who has decided asks no more.
    assert asked == [2.9, 1.9]


def test_whom_others_would_run_over_stays():
    asked = []

    def may_go(walk):
        asked.append(walk.starts_s)
        return False

    one = crosser(may_go)
    one.look(5.0, lambda: 1.9)
    one.look(5.05, lambda: 1.85)
    assert one.went is False
    assert asked == [pytest.approx(4.9)]
    assert one.pose(9.0) == (20.0, -4.0, WALK.heading)


@pytest.mark.parametrize("side", [1, -1])
def test_a_change_by_hand(side):
    """10 m/s along; from 2 s on 1.5 m/s across, until 3.5 m are done after 2.33 s."""
    change = LaneChange((5.0, side * 3.5), 10.0, begins_s=2.0, lateral_mps=1.5, to_y=0.0)
    places = {0.0: (5.0, 3.5), 2.0: (25.0, 3.5), 3.0: (35.0, 2.0), 4.0: (45.0, 0.5), 5.0: (55.0, 0)}
    for time, (x, y) in places.items():
        assert change.pose(time) == pytest.approx((x, side * y, 0.0))


@given(
    st.builds(
        LaneChange,
        st.tuples(st.floats(-90, 90), st.floats(-9, 9)),
        *(st.floats(0, 30), st.floats(-2, 9), st.floats(0.1, 3), st.floats(-9, 9)),
    ),
    st.lists(st.floats(-1, 60), max_size=50),
)
def test_all_poses_of_a_change_at_once_are_those_one_by_one(change, times):
    each = np.array([change.pose(time) for time in times]).reshape(-1, 3)
    assert change.poses(np.array(times)).tobytes() == each.tobytes()


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
