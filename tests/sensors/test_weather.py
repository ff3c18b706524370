import math

import pytest

from care_sim.sensors.signal import fog_extinction, rain_extinction


def test_at_the_visibility_two_per_cent_of_the_light_are_left():
    for visibility in (30.0, 50.0, 1000.0):
        left = math.exp(-fog_extinction(visibility) * visibility)
        assert left == pytest.approx(0.02, rel=1e-3)


def test_clear_air_takes_nothing_away():
    assert fog_extinction(0.0) == rain_extinction(0.0) == 0.0


def test_rain_takes_what_the_itu_says_from_a_kilometre():
    """1.076 dB at 1 mm/h, and ten times the decibels at 10^(1 / 0.67) = 31.1 mm/h."""
    for rain, decibels in ((1.0, 1.076), (10 ** (1 / 0.67), 10.76)):
        left = math.exp(-rain_extinction(rain) * 1000)
        assert -10 * math.log10(left) == pytest.approx(decibels)
