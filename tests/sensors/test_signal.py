import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.conditions import ReturnSettings
from care_sim.sensors.signal import Signal

METRES = np.linspace(1, 200, 2000)


def seen_to(brightness, **settings):
    """The farthest of METRES from which a surface is noticed; of those before it all are."""
    signal = Signal(ReturnSettings(lidar_stated_range_m=40.0, **settings))
    bright = np.full(len(METRES), brightness)
    noticed = signal.suffices(signal.intensities(bright, METRES), METRES)
    assert not noticed[np.argmin(noticed) :].any()
    return METRES[np.argmin(noticed) - 1]


def test_the_stated_target_is_seen_from_the_stated_range_and_no_farther():
    assert seen_to(0.1) == pytest.approx(40, abs=0.1)
    assert seen_to(0.8, lidar_stated_reflectance=0.8) == pytest.approx(40, abs=0.1)


def test_four_times_the_brightness_are_seen_from_twice_the_range():
    """Data sheets hold to it: 40 m at 10% are 113 m at 80%, of which Ouster states 120 m."""
    assert seen_to(0.4) == pytest.approx(80, abs=0.1)
    assert seen_to(0.8) == pytest.approx(40 * np.sqrt(8), abs=0.1)


def test_fog_takes_the_light_twice_on_its_way_there_and_back():
    """At the range where rho / r^2 times exp(-2 * 3.912 r / V) is 0.1 / 40^2."""
    reached = seen_to(0.5, visibility_m=50.0)
    assert 0.5 / reached**2 * np.exp(-2 * 3.912 * reached / 50) == pytest.approx(
        0.1 / 40**2, rel=0.05
    )


def test_without_a_stated_range_everything_in_reach_is_noticed_and_nothing_else():
    signal = Signal(ReturnSettings())
    ranges = np.array([1.0, 49.0, np.inf])
    assert signal.suffices(signal.intensities(np.zeros(3), ranges), ranges).tolist() == [
        True,
        True,
        False,
    ]


@pytest.mark.filterwarnings("error")
def test_the_least_range_in_the_thickest_fog_is_a_number():
    signal = Signal(ReturnSettings(lidar_stated_range_m=0.01, visibility_m=0.01, rain_mm_h=1000.0))
    ranges = np.array([1e-6, 1.0, 1e6, np.inf])
    intensities = signal.intensities(np.ones(4), ranges)
    assert np.isfinite(intensities).all()
    assert signal.suffices(intensities, ranges).tolist() == [True, False, False, False]


def test_intensities_are_those_of_the_surface_in_clear_air_and_nothing_without_one():
    signal = Signal(ReturnSettings(lidar_stated_range_m=40.0))
    assert signal.intensities(np.array([0.3, 0.3]), np.array([5.0, np.inf])).tolist() == [0.3, 0.0]


@given(st.floats(0, 1), st.floats(0.5, 200), st.floats(10, 5000), st.floats(0.1, 100))
def test_weather_never_brightens(brightness, metres, visibility, rain):
    bright, ranges = np.array([brightness]), np.array([metres])
    clear, fog, both = (
        Signal(ReturnSettings(lidar_stated_range_m=40.0, **weather)).intensities(bright, ranges)
        for weather in (
            {},
            {"visibility_m": visibility},
            {"visibility_m": visibility, "rain_mm_h": rain},
        )
    )
    assert 0 <= both <= fog <= clear == brightness
