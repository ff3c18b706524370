import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import (
    COLUMNS_WHERE_CHANGED,
    DEFAULTS,
    RAYS,
    RETURN_SETTINGS,
    Conditions,
    FilmedReturns,
    ReturnSettings,
    changed_settings,
)


def test_the_switches_are_conditions_of_both_loops_and_off():
    usual = Conditions()
    assert usual.filmed == RAYS
    assert not usual.shapes_beams
    assert {*RETURN_SETTINGS} <= {*DEFAULTS} & {*COLUMNS_WHERE_CHANGED}


@pytest.mark.parametrize(
    ("given", "needed"),
    [
        ({"visibility_m": 50.0}, "visibility_m has no meaning without lidar_stated_range_m"),
        ({"rain_mm_h": 5.0}, "rain_mm_h has no meaning without lidar_stated_range_m"),
        ({"lidar_stated_reflectance": 0.8}, "lidar_stated_reflectance has no meaning without"),
        ({"lidar_returns": "last"}, "lidar_returns has no meaning without lidar_divergence_mrad"),
        ({"lidar_returns": "first"}, "unknown lidar_returns 'first'; known: both, last, strongest"),
        ({"lidar_compensated": True}, "lidar_compensated has no meaning without lidar_sweep_s"),
        ({"lidar_stated_range_m": -1.0}, "lidar_stated_range_m must lie in"),
        ({"lidar_stated_range_m": 1e-200}, "lidar_stated_range_m must be 0 or at least 0.01, got"),
        (
            {"lidar_stated_range_m": 40.0, "visibility_m": 1e-310},
            "visibility_m must be 0 or at least 0.01, got",
        ),
    ],
)
def test_a_setting_that_says_nothing_is_refused(given, needed):
    for kind in (Conditions, ReturnSettings):
        with pytest.raises(InvalidInput, match=needed):
            kind(**given)


def test_a_film_takes_these_settings_alone():
    given = {"lidar_stated_range_m": 40.0, "visibility_m": 100.0}
    filmed = Conditions(**given, lidar_dropout=0.2).filmed
    assert filmed == FilmedReturns(**given)
    assert changed_settings(filmed, RAYS) == ["lidar_stated_range_m", "visibility_m"]


def test_a_film_holds_what_more_shots_return_where_pulses_have_strength():
    assert Conditions(firing="energy:6", lidar_stated_range_m=40.0).filmed.most_shots == 6
    assert Conditions(firing="energy:6", lidar_dropout=0.2).filmed == RAYS
    assert Conditions(firing="tiles", lidar_stated_range_m=40.0).filmed.most_shots == 1
