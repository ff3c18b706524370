"""The plays of the published studies: their tables of levels as configurations."""

from collections import Counter

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.policies import controls
from care_sim.scenarios.ncap.table import TESTS
from care_sim.scenarios.r157 import kinds_in_turn, preventable
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs import ablations, paper, standards, validate
from care_sim.study.designs.defaults import NCAP_POLICIES
from care_sim.study.designs.faults import fault_study
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace
from care_sim.study.episode_config import EpisodeConfig, of_seeds
from care_sim.study.rows.reading import key_of

STREETS = Streets("evaluation")
SCENE = Scene("street-0000", 0)
SHORT = (("duration_s", 0.2),)


def test_the_papers_study_has_245_episodes_in_the_stated_split():
    configs = paper.paper_study(range(5))
    assert len(configs) == len(set(configs)) == 245
    assert Counter(config.seed for config in configs) == dict.fromkeys(range(5), 49)
    faultless = [c for c in configs if not (c.false_negative_rate or c.camera_latency)]
    assert Counter(c.scenario for c in faultless if c.seed == 0) == {
        "dense": 17,
        "dartout": 13,
        "cutin": 5,
    }
    assert sum(c.false_negative_rate > 0 for c in configs) == 8 * 5
    assert sum(c.camera_latency > 0 for c in configs) == 6 * 5
    assert {c.budget for c in configs if c.policy == "full"} == {1.0}


def test_every_published_result_belongs_to_a_cell_that_is_run():
    found = {
        paper.published_result(
            c.scenario, c.policy, c.budget, bool(c.false_negative_rate or c.camera_latency)
        )
        for c in paper.paper_study([0])
    }
    assert found == {None, *paper.PUBLISHED_RESULTS}
    assert paper.published_result("dartout", "history", 0.1, False).detection_m == 11.9
    assert paper.published_result("dartout", "history", 0.1, False).braked == 3
    assert paper.published_result("dartout", "history", 0.03, False) is None


def test_crowding_varies_the_vehicles_from_none_to_all():
    configs = paper.crowding_study([0])
    assert {dict(c.scenario_parameters)["vehicles"] for c in configs} == set(range(13))
    assert len(configs) == 13 * (2 * 8 + 1)


def test_every_level_and_reference_of_the_ablations_is_one_play_of_a_scene():
    place = FilmPlace("streets", 0.1)
    plays = ablations.ablation_plays(STREETS, [SCENE], [0.1])
    played = Counter(key_of(config.row()) for config in plays)
    assert set(played.values()) == {1}
    wanted = {USUAL_VARIANT.key(place, "full")}
    for ablation in ablations.OPEN_ABLATIONS:
        for level in ablation.levels:
            wanted.add(level.key(place, ablation.policy))
            wanted |= {level.for_others().key(place, policy) for policy in ablation.references}
    assert set(played) == wanted
    assert len(ablations.ablation_study([0])) == 162


def test_further_policies_are_played_where_conditions_vary_and_the_full_scan_once():
    several = ablations.ablation_plays(STREETS, [SCENE], [0.1, 0.2], ["random"])
    conditions = {
        tuple(pair for pair in config.row().items() if pair[0] != "budget")
        for config in several
        if config.policy == "random"
    }
    # The usual ones, two of rho, two margins, one confidence, one latency, six orders of cells:
    # rows-down by its name is that of a policy which lists its sets otherwise.
    assert len(conditions) == 1 + 2 + 2 + 1 + 1 + 6
    assert sum(config.policy == "full" for config in several) == 1


def test_the_quarter_of_the_streets_holds_every_layout():
    """38 scenes, as many as the paper's. Every fourth street would be straight."""
    quarter = ablations.quarter_of(STREETS.scenes())
    assert len(quarter) == 38
    assert [scene.seed for scene in quarter[:5]] == [0, 5, 10, 15, 16]
    layouts = Counter(scene.name.split("-", 2)[2] for scene in quarter)
    assert len(layouts) == 4
    assert min(layouts.values()) >= 9


def test_the_speeds_and_readings_of_euro_ncap():
    cases = standards.ncap_cases(["CBLA-50"], 10.0)
    assert [case.ego_kph for case in cases] == [30.0, 40.0, 50.0, 60.0]
    assert {case.target_kph for case in cases} == {15.0}
    assert standards.ncap_cases(["CPTAns-50"], 50.0) == []
    # Both readings where cars hide the target.
    readings = standards.ncap_cases(["CPNCO-50", "CPNA-25"], 20.0)
    assert Counter((case.test, case.reported) for case in readings) == {
        ("CPNCO-50", True): 3,
        ("CPNCO-50", False): 3,
        ("CPNA-25", None): 3,
    }
    assert {dict(case.parameters).get("occluder_reported") for case in readings} == {
        True,
        False,
        None,
    }
    # A crossing car has the speed of the ego.
    crossing = standards.ncap_cases(["CCCscp-far", "CCFtap"], 10.0)
    assert all(c.ego_kph == c.target_kph for c in crossing if c.test == "CCCscp-far")
    assert {c.target_kph for c in crossing if c.test == "CCFtap"} == {30.0, 45.0, 60.0}


def test_the_configurations_of_euro_ncap_are_as_many_as_stated():
    assert len(standards.ncap_cases([*TESTS], 10.0)) == 140
    assert len(standards.ncap_cases([*TESTS], 5.0)) == 214
    configs = standards.ncap_study([4], tests=["CPTAno-50"])
    assert len(configs) == 16
    assert {config.policy for config in configs} == set(NCAP_POLICIES)
    assert {config.seed for config in configs} == {4}


def test_every_preventable_cut_in_and_no_other_is_played(monkeypatch):
    few = preventable(kinds_in_turn())[::100]
    monkeypatch.setattr(standards, "kinds_in_turn", lambda: [*few, *kinds_in_turn()[:3]])
    configs = standards.r157_study([0, 1], driver="careful-human")
    assert {standards.case_of(config.row()) for config in configs} == {*few}
    policies = ("history", "all-camera", "care", "fan")
    budgeted = [(policy, budget) for policy in policies for budget in (0.01, 0.03)]
    played = Counter((config.policy, config.budget) for config in configs)
    assert played == dict.fromkeys([*budgeted, ("full", 1.0)], 2 * len(few))
    assert {config.driver for config in configs} == {"careful-human"}
    # They are as if each had been checked.
    for config in configs[::7]:
        parameters = tuple(vars(standards.case_of(config.row())).items())
        own = config.policy, config.budget, config.seed
        again = EpisodeConfig("r157", *own, driver="careful-human", scenario_parameters=parameters)
        assert (config, config.row()) == (again, again.row())


def test_one_cut_in_of_some_is_of_the_same_kinds_and_sides():
    whole = standards.r157_study([0], ["care"], [0.02])
    of_whole = Counter(standards.case_of(config.row()).kind for config in whole)
    for every in (2, 3, 10):
        few = standards.r157_study([0], ["care"], [0.02], every=every)
        assert len(few) == -(-379 // every)
        assert few == sorted(few, key=whole.index)
        kinds = Counter(standards.case_of(config.row()).kind for config in few)
        for kind, number in of_whole.items():
            assert abs(kinds[kind] / len(few) - number / len(whole)) < 0.13


def test_no_seed_of_a_validation_is_both_and_each_part_has_its_policies():
    levels = validate.levels_of(SHORT, [(("mirrored", "always"),)])
    configs = validate.validation_study("cutin", levels, [0.03, 0.1], range(3), 2)
    parts = {True: Counter(), False: Counter()}
    seeds = {True: set(), False: set()}
    for config in configs:
        part = validate.is_training(config.row())
        parts[part][config.policy] += 1
        seeds[part].add(config.seed)
    assert seeds == {True: {10_000, 10_001}, False: {0, 1, 2}}
    # Two worlds, two budgets; the full scan has one.
    chosen = [*validate.CAMERA_POLICIES, *controls()]
    assert parts[True] == dict.fromkeys(chosen, 2 * 2 * 2)
    others = [*chosen, "history", "random", validate.MEMORISER]
    assert parts[False] == dict.fromkeys(others, 2 * 2 * 3) | {"full": 2 * 3}
    # Policies that learn do so on as many seeds as are trained on.
    told = {(c.policy, dict(c.policy_parameters).get("seeds")) for c in configs}
    assert {number for policy, number in told if policy.endswith("learned-place")} == {2}
    assert {(validate.MEMORISER, 2000), ("care", None)} < told
    with pytest.raises(InvalidInput, match=r"seeds of a test must lie below 1,000, got 10001"):
        validate.validation_study("cutin", levels, [0.1], [10_001], 2)


def test_a_level_of_a_validation_is_the_base_with_one_factor_changed():
    base = (("vehicles", 3), ("mirrored", "drawn"))
    factors = [(("vehicles", 5),), (("occluder", "van"),), (("vehicles", 3),)]
    assert [dict(level) for level in validate.levels_of(base, factors)] == [
        {"vehicles": 3, "mirrored": "drawn"},
        {"vehicles": 5, "mirrored": "drawn"},
        {"vehicles": 3, "mirrored": "drawn", "occluder": "van"},
    ]


@pytest.mark.parametrize(
    "study",
    [
        paper.paper_study,
        ablations.ablation_study,
        paper.crowding_study,
        fault_study,
        standards.r157_study,
    ],
)
def test_a_study_of_several_seeds_is_that_of_one_with_each(study, monkeypatch):
    """Commands make the configurations of one seed, and give them all seeds."""
    monkeypatch.setattr(EpisodeConfig, "__post_init__", lambda self: None)
    assert of_seeds(study((3,), ["random"]), (3, 1, 4)) == study((3, 1, 4), ["random"])
