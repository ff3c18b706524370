import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.driving.drivers import HUMAN_MODEL as HUMAN

TIMES = np.linspace(0, 6, 60_001)


def test_the_numbers_are_those_of_table_1():
    """UN Regulation 157, Annex 3, Table 1; 12.65 m/s^3 is what 0.774 g in 0.6 s comes to."""
    assert (HUMAN.wander_m, HUMAN.evaluation_s, HUMAN.delay_s) == (0.375, 0.4, 0.75)
    assert (HUMAN.danger_s, HUMAN.jerk_s) == (2.0, 0.6)
    assert pytest.approx(7.59, abs=0.005) == HUMAN.brake_mps2
    assert pytest.approx(12.65, abs=0.005) == HUMAN.jerk_mps3


def test_the_braking_by_hand():
    """Nothing for 0.75 s, then half of 7.59 m/s^2 over 0.6 s, then all of it."""
    times = np.array([0.0, 0.75, 1.35, 2.35])
    ramp = HUMAN.brake_mps2 * 0.6 / 2
    assert HUMAN.speed_lost(times) == pytest.approx([0, 0, ramp, ramp + HUMAN.brake_mps2])
    saved = ramp * 0.6 / 3
    last = saved + ramp + HUMAN.brake_mps2 / 2
    assert HUMAN.distance_saved(times) == pytest.approx([0, 0, saved, last])


def test_what_is_saved_is_the_speed_lost_summed_up():
    lost = HUMAN.speed_lost(TIMES)
    summed = np.cumsum((lost[1:] + lost[:-1]) / 2 * np.diff(TIMES))
    assert HUMAN.distance_saved(TIMES[1:]) == pytest.approx(summed, abs=1e-6)


@given(st.floats(0.01, 40))
def test_the_time_to_lose_a_speed_undoes_the_speed_lost(speed):
    times = HUMAN.time_to_lose(np.array([speed]))
    assert HUMAN.speed_lost(times) == pytest.approx([speed])
