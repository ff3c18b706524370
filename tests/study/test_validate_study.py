"""What the validation of a world plays."""

from collections import Counter

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.policies import controls
from care_sim.study.designs.validate import (
    CAMERA_POLICIES,
    MEMORISER,
    is_training,
    levels_of,
    validation_study,
)

SHORT = (("duration_s", 0.2),)


@pytest.fixture(scope="module")
def configs():
    levels = levels_of(SHORT, [(("mirrored", "always"),)])
    return validation_study("cutin", levels, [0.03, 0.1], range(3), 2)


def test_no_seed_is_both_and_each_part_has_its_policies(configs):
    parts = {True: Counter(), False: Counter()}
    for config in configs:
        parts[is_training(config.row())][config.policy] += 1
    seeds = {part: {c.seed for c in configs if is_training(c.row()) is part} for part in parts}
    assert seeds == {True: {10_000, 10_001}, False: {0, 1, 2}}
    # Two worlds, two budgets; the full scan has one.
    chosen = [*CAMERA_POLICIES, *controls()]
    assert parts[True] == dict.fromkeys(chosen, 2 * 2 * 2)
    others = [*chosen, "history", "random", MEMORISER]
    assert parts[False] == dict.fromkeys(others, 2 * 2 * 3) | {"full": 2 * 3}


def test_what_is_learned_is_learned_on_as_many_seeds_as_are_trained_on(configs):
    told = {(c.policy, dict(c.policy_parameters).get("seeds")) for c in configs}
    assert {number for policy, number in told if policy.endswith("learned-place")} == {2}
    assert (MEMORISER, 2000) in told
    assert all(dict(c.policy_parameters)["hidden_first"] for c in configs if c.policy == MEMORISER)
    assert ("care", None) in told


def test_a_level_is_the_base_with_one_factor_changed():
    base = (("vehicles", 3), ("mirrored", "drawn"))
    levels = levels_of(base, [(("vehicles", 5),), (("occluder", "van"),), (("vehicles", 3),)])
    assert [dict(level) for level in levels] == [
        {"vehicles": 3, "mirrored": "drawn"},
        {"vehicles": 5, "mirrored": "drawn"},
        {"vehicles": 3, "mirrored": "drawn", "occluder": "van"},
    ]


def test_a_test_seed_of_the_training_is_refused():
    with pytest.raises(InvalidInput, match=r"seeds of a test must lie below 1,000, got 10001"):
        validation_study("cutin", [SHORT], [0.1], [10_001], 2)
