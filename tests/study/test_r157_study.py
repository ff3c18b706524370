from collections import Counter

import numpy as np

from care_sim.scenarios import make_scenario
from care_sim.scenarios.r157 import kinds_in_turn, preventable
from care_sim.study.designs import standards
from care_sim.study.episode_config import EpisodeConfig, grid


def test_the_study_plays_every_preventable_case_and_no_other(monkeypatch):
    few = preventable(kinds_in_turn())[::100]
    monkeypatch.setattr(standards, "kinds_in_turn", lambda: [*few, *kinds_in_turn()[:3]])
    configs = standards.r157_study([0, 1])
    assert {standards.case_of(config.row()) for config in configs} == {*few}
    played = Counter((config.policy, config.budget) for config in configs)
    policies = ("history", "all-camera", "care", "fan")
    budgeted = [(policy, budget) for policy in policies for budget in (0.01, 0.03)]
    assert played == dict.fromkeys([*budgeted, ("full", 1.0)], 2 * len(few))
    assert {config.driver for config in configs} == {"fixed"}
    assert {config.driver for config in standards.r157_study([0], driver="careful-human")} == {
        "careful-human"
    }


def test_one_case_of_some_is_of_the_same_kinds_and_sides():
    whole = [
        standards.case_of(config.row()) for config in standards.r157_study([0], ["care"], [0.02])
    ]
    for every in (2, 3, 5, 10):
        few = standards.r157_study([0], ["care"], [0.02], every=every)
        kinds = Counter(standards.case_of(config.row()).kind for config in few)
        sides = Counter(standards.case_of(config.row()).side for config in few)
        for counted, names in ((kinds, [c.kind for c in whole]), (sides, [c.side for c in whole])):
            for name, number in Counter(names).items():
                assert abs(counted[name] / len(few) - number / len(whole)) < 0.13


def test_one_case_of_three_is_a_third_of_the_same():
    whole = standards.r157_study([0], ["care", "fan"], [0.02])
    few = standards.r157_study([0], ["care", "fan"], [0.02], every=3)
    assert (len(whole), len(few)) == (2 * 379, 2 * 127)
    assert set(few) < set(whole)
    assert few == sorted(few, key=whole.index)


def test_configurations_are_as_if_each_had_been_checked():
    for config in standards.r157_study([3], ["care", "full"], [0.01])[::401]:
        again = EpisodeConfig(
            "r157",
            config.policy,
            config.budget,
            3,
            scenario_parameters=tuple(vars(standards.case_of(config.row())).items()),
        )
        assert (config, config.row()) == (again, again.row())


def test_a_case_as_parameters_is_the_case_that_is_drawn():
    for case in kinds_in_turn()[::97]:
        config, *_ = grid(
            ["r157"], ["care"], [0.1], [0], scenario_parameters=tuple(vars(case).items())
        )
        scenario = make_scenario("r157", **dict(config.scenario_parameters))
        assert scenario.draw_case(np.random.default_rng(0)) == case
