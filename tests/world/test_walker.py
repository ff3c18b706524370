from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.world.motions import Walk

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


def test_pose_goes_along_the_heading():
    assert RUN.pose(0.0) == pytest.approx((10.0, -4.0, np.pi / 2))
    assert RUN.pose(2.5) == pytest.approx((10.0, -0.875, np.pi / 2))
    assert RUN.pose(60.0)[:2] == pytest.approx((10.0, 4.0))


@pytest.mark.parametrize(
    ("distance", "duration"), [(0.0, 0.0), (0.1, 0.2), (0.625, 0.5), (3.125, 1.5)]
)
def test_durations_worked_by_hand(distance, duration):
    assert RUN.duration_to(distance) == pytest.approx(duration)


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


def test_setting_off_changes_only_the_time():
    later = RUN.setting_off(3.0)
    assert later.starts_s == 3.0
    assert later.covered(4.5) == pytest.approx(RUN.covered(2.5))


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
