"""A result is played again: which worlds are drawn, and what is false in a file."""

from collections import Counter
from dataclasses import replace
from random import Random

from care_sim.study.benchmark.budgets import BudgetRow
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.replay import replayed
from care_sim.study.benchmark.result import read_result
from care_sim.study.benchmark.suite import DRIVES, STREETS, TESTS, Entry
from tests.helpers.made_budgets import HALF_WAY, NEVER, made_budgets, made_plays
from tests.helpers.places import EXAMPLES


def test_a_tenth_of_every_part_is_drawn_and_five_worlds_or_all_of_small_parts(tmp_path):
    """No count of the file holds, so that every world that is played differs."""
    entry = Entry("care")
    result = made_budgets(entry, NEVER, made_by=made_by(entry))
    own = [*((TESTS, seed) for seed in range(200, 212)), (DRIVES, 200), (DRIVES, 201)]
    episodes = (BudgetRow(*world, (1.0, 0.0), ((1.0, 0.0),) * 7) for world in own)
    result = replace(result, rows=(*result.rows, *episodes))
    with made_plays(tmp_path) as player:
        replays = [replayed(result, player, Random(seed)) for seed in (1, 2, 3, 1)]
    drawn = [{*replay.differing} for replay in replays]
    for worlds, replay in zip(drawn, replays, strict=True):
        assert Counter(part for part, _ in worlds) == {STREETS: 8, TESTS: 5, DRIVES: 2}
        assert (replay.played, replay.false) == (15, ("15 of 15 worlds have other counts",))
    # Another lot draws other worlds, and the same lot the same.
    together = Counter(part for part, _ in set.union(*drawn))
    assert (together[STREETS] > 15, together[TESTS] > 8) == (True, True)
    assert drawn[0] == drawn[3]


def test_a_file_that_gives_its_policy_other_tags_is_false(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    path = tmp_path / "mine.json"
    for tags, false in (
        (("causal",), ()),
        (("learned",), ("it says that the policy is learned, and it is causal",)),
        (("causal", "control"), ("it says that the policy is causal, control, and it is causal",)),
    ):
        made_budgets("aimed_boxes:AimedBoxes", HALF_WAY, tags=tags).write(path)
        with made_plays(tmp_path) as player:
            replay = replayed(read_result(path), player, Random(1))
        assert (replay.differing, replay.false) == ((), false)
