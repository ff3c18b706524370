"""Whether the ego ran into what it touched, or that ran into the ego."""

import numpy as np
import pytest

from care_sim.world.approach import lies_ahead
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

EGO = (10.0, 5.0, np.pi / 2)
LENGTH = 4.0


def box(x, y, yaw=0.0, length=0.6, width=0.6):
    return np.array([x, y, 0.9, length, width, 1.8, yaw])


@pytest.mark.parametrize(
    ("other", "ahead"),
    [
        (box(10.0, 7.2), True),
        (box(10.9, 6.9), True),
        (box(11.2, 6.0), False),
        (box(10.0, 2.8), False),
        # A car across the way: its side is hit, though it reaches far to both sides.
        (box(10.0, 7.9, 0.0, 4.6, 1.9), True),
        # A car that comes from the side hits the ego's side.
        (box(13.2, 6.0, 0.0, 4.6, 1.9), False),
    ],
)
def test_what_lies_ahead_is_run_into(other, ahead):
    assert lies_ahead(other, EGO, LENGTH) is ahead


def test_the_first_contact_is_told():
    traffic = Traffic((1,), ego_lane=0, lane_width=3.5, speed_limit=20.0)
    world = World(traffic, 8.0)
    standing = world.add("child", "child", (6.0, 0.2, 0.0))
    impact = world.advance(0.0, 1.0).impact
    world.close()
    assert (impact.body, impact.speed_mps, impact.at_front) == (standing.body, 8.0, True)
