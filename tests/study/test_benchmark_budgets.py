"""B90 of entries: which worlds are played at which budgets."""

import pytest

from care_sim.base.seeds import split_of
from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.study.benchmark.budgets import budget_tasks, budget_worlds, counts_of
from care_sim.study.benchmark.suite import DRIVES, STREETS, TESTS, Entry
from tests.helpers.made_budgets import HALF_WAY, made_budgets


def test_streets_are_test_seeds_and_a_trial_plays_the_first_of_them():
    whole, trial = budget_worlds()[STREETS], budget_worlds(quick=True)[STREETS]
    assert split_of(whole) == "test"
    assert min(whole) == 200
    assert trial == whole[: len(trial)]
    assert len(trial) < len(whole)
    closed = budget_worlds(closed_loop=True)
    assert {part: len(seeds) for part, seeds in closed.items()} == {
        STREETS: 80,
        DRIVES: 24,
        TESTS: 40,
    }


@pytest.mark.parametrize(("part", "latency"), [(STREETS, 0.0), (DRIVES, 0.12), (TESTS, 0.12)])
def test_a_world_is_played_by_the_full_scan_and_at_every_budget(part, latency):
    entry = Entry("care-sector", (("residual", False),))
    worlds = budget_tasks(entry, part, [200, 203], "megvii")
    assert len(worlds) == 2
    for full, *own in worlds:
        assert (full.policy, full.budget) == ("full", 1.0)
        assert [config.budget for config in own] == [*BUDGETS]
        for config in own:
            assert (config.policy, config.policy_parameters) == (entry.policy, entry.parameters)
            assert (config.camera_profile, config.camera_latency_s) == ("kitti", latency)
        assert {config.detector for config in (full, *own)} == {"megvii"}
    scenes = [getattr(task[0], "scene", None) or task[0].seed for task in worlds]
    assert len({*scenes}) == 2


def test_entries_share_the_full_scan():
    (one, *_), (other, *_) = (
        budget_tasks(Entry(name), STREETS, [200], "centerpoint")[0] for name in ("care", "boxes")
    )
    assert one == other


def test_the_counts_of_an_episode():
    row = {"collision": False, "braked_before_view": False}
    assert counts_of(DRIVES, row) == (1.0, 0.0)
    assert counts_of(DRIVES, row | {"collision": True}) == (0.0, 0.0)
    assert counts_of(DRIVES, row | {"braked_before_view": True}) == (0.0, 1.0)


def test_a_result_is_cut_to_worlds_in_their_order():
    result = made_budgets("care", HALF_WAY, streets=4)
    cut = result.cut_to([(STREETS, 202), (STREETS, 200)])
    assert cut.worlds == ((STREETS, 202), (STREETS, 200))
    assert result.cut_to([(STREETS, 202), (STREETS, 999)]) is None
