"""Comfortable driving: by the plan, and behind who drives ahead."""

from functools import cache

import numpy as np
import pytest

from care_sim.core.types import Command, Tracks
from care_sim.driving.drivers import Cruising, CruisingRules
from care_sim.world.route import Route, SpeedPlan

CRUISE, FRONT, HALF_WIDTH, KEYFRAME = 8.0, 1.5, 0.9, 0.1
RULES = CruisingRules()
FREE = Command(1.5, False)


def tracks(*rows):
    """Cars at (x, y) with a velocity along the way, m/s."""
    count = len(rows)
    boxes = np.array([(x, y, 0.8, 4.6, 1.9, 1.7, 0.0) for x, y, _ in rows]).reshape(-1, 7)
    velocities = np.array([(vx, 0.0) for *_, vx in rows]).reshape(-1, 2)
    none = np.zeros(count, np.int64)
    return Tracks(np.arange(count), none, boxes, velocities, none, none + 2)


STRAIGHT = Route(legs=((300.0, 0.0),))


@cache
def cruising(route):
    return Cruising(SpeedPlan(route, CRUISE, 2.0, 1.5), FRONT, HALF_WIDTH, KEYFRAME)


def eased(*rows, speed=CRUISE, along=0.0, command=FREE, route=STRAIGHT):
    return cruising(route).eased(command, tracks(*rows), speed, along)


def test_the_brake_is_left_alone():
    braking = Command(-5.0, True)
    assert eased((9.0, 0.0, 4.0), command=braking) == braking


def test_a_free_way_is_driven_at_cruising_speed():
    assert eased(speed=CRUISE).acceleration == pytest.approx(0.0)
    assert eased(speed=4.0).acceleration == 1.5


def test_a_bend_ahead_slows_the_car():
    bend = Route(legs=((30.0, 0.0), (12.0, 1 / 8.0), (30.0, 0.0)))
    speed, along = CRUISE, 0.0
    fastest = 0.0
    while along < 42.0:
        speed += eased(speed=speed, along=along, route=bend).acceleration * KEYFRAME
        along += speed * KEYFRAME
        fastest = max(fastest, speed**2 * abs(bend.curvature(along)))
    # 2 m/s^2 sideways, and a little more within the keyframe in which the bend begins.
    assert 1.9 < fastest < 2.2


def test_who_drives_ahead_is_followed_at_the_gap_of_the_model():
    gap, speed, lead = 40.0, CRUISE, 6.0
    for _ in range(900):
        ahead = FRONT + gap + 2.3
        speed += eased((ahead, 0.0, lead), speed=speed).acceleration * KEYFRAME
        gap += (lead - speed) * KEYFRAME
    # In equilibrium s = (s_0 + v T) / sqrt(1 - (v / v_0)^4).
    wanted = (2.0 + 6.0 * 1.5) / np.sqrt(1 - (6.0 / CRUISE) ** 4)
    assert speed == pytest.approx(lead, abs=0.01)
    assert gap == pytest.approx(wanted, abs=0.05)


@pytest.mark.parametrize(
    "other",
    [
        (12.0, 0.0, 0.0),
        (12.0, 3.5, 5.0),
        (-8.0, 0.0, 5.0),
        (12.0, 0.0, -5.0),
    ],
    ids=["stands", "beside", "behind", "oncoming"],
)
def test_only_who_drives_ahead_in_the_way_is_followed(other):
    assert eased(other) == eased()


def test_the_nearest_is_followed():
    near, far = (14.0, 0.0, 5.0), (30.0, 0.0, 2.0)
    assert eased(far, near) == eased(near)


def test_slowing_is_never_harder_than_comfortable():
    assert eased((FRONT + 2.5, 0.0, 1.0)).acceleration == -RULES.slowing_mps2
