"""Somebody who waits until the ego is near."""

import pytest

from care_sim.world.motions import Crosser, Walk

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
    # Who has decided asks no more.
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
