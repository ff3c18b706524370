"""What `care-sim study ncap` plays."""

from collections import Counter

import pytest

from care_sim.scenarios.ncap.table import TESTS
from care_sim.study.designs.defaults import NCAP_POLICIES
from care_sim.study.designs.standards import NcapCase, ncap_cases, ncap_study
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode


def test_the_protocols_speeds_are_played_in_steps():
    cases = ncap_cases(["CBLA-50"], 10.0)
    assert [case.ego_kph for case in cases] == [30.0, 40.0, 50.0, 60.0]
    assert {case.target_kph for case in cases} == {15.0}
    assert len(ncap_cases(["CBLA-50"], 5.0)) == len(TESTS["CBLA-50"].variations) == 8
    assert ncap_cases(["CPTAns-50"], 50.0) == []


def test_a_test_with_cars_that_hide_comes_in_both_readings():
    cases = ncap_cases(["CPNCO-50", "CPNA-25"], 20.0)
    assert Counter((case.test, case.reported) for case in cases) == {
        ("CPNCO-50", True): 3,
        ("CPNCO-50", False): 3,
        ("CPNA-25", None): 3,
    }


def test_a_crossing_car_has_the_speed_of_the_ego():
    cases = ncap_cases(["CCCscp-far", "CCFtap"], 10.0)
    assert all(case.ego_kph == case.target_kph for case in cases if case.test == "CCCscp-far")
    assert {case.target_kph for case in cases if case.test == "CCFtap"} == {30.0, 45.0, 60.0}


def test_the_configurations_of_a_seed_are_as_many_as_stated():
    """Made for one test; the others differ in the numbers alone."""
    assert len(ncap_cases([*TESTS], 10.0)) == 140
    assert len(ncap_cases([*TESTS], 5.0)) == 214
    configs = ncap_study([4], tests=["CPTAno-50"])
    assert len(configs) == 16
    assert {config.policy for config in configs} == set(NCAP_POLICIES)
    assert {config.seed for config in configs} == {4}


@pytest.mark.parametrize("reported", [True, False, None])
def test_every_row_tells_the_reading(reported):
    names = dict(NcapCase("CPNCO-50", 20.0, 5.0, reported).parameters)
    assert names.get("occluder_reported") is reported


def test_a_row_tells_the_test_that_its_seed_drew_and_others_have_no_such_column():
    short = ("duration_s", 0.1)
    drawn = (("test", "drawn"), ("speed_kph", 0.0), short)
    rows = [
        run_episode(EpisodeConfig("ncap", "fan", 0.01, seed, scenario_parameters=drawn))
        for seed in range(3)
    ]
    for row in rows:
        pairs = {(each.ego_kph, each.target_kph) for each in TESTS[row["drawn.test"]].variations}
        assert (row["drawn.speed_kph"], row["drawn.target_kph"]) in pairs
        assert row["scenario.test"] == "drawn"
    assert len({row["drawn.test"] for row in rows}) > 1
    given = run_episode(EpisodeConfig("ncap", "fan", 0.01, scenario_parameters=(short,)))
    assert [name for name in given if name.startswith("drawn")] == ["drawn.mirrored"]
