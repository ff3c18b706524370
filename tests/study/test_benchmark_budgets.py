"""B90 of entries: which worlds are played at which budgets."""

import json
from dataclasses import replace

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import split_of
from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.study.benchmark import result as result_files
from care_sim.study.benchmark.budgets import budget_tasks, budget_worlds, counts_of, play_budgets
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.recorded import AHEAD, RECORDED, recorded_drives
from care_sim.study.benchmark.result import read_result
from care_sim.study.benchmark.suite import DRIVES, STREETS, TESTS, TIGHT_TESTS, Entry
from tests.helpers import kitti_drive
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, NEVER, made_budgets, made_plays


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
        TIGHT_TESTS: 80,
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


def test_a_recorded_drive_is_played_as_a_street_is(tmp_path):
    kitti_drive.write(tmp_path)
    drives = recorded_drives([f"kitti:{tmp_path}", "boreas"])
    assert [drive.name for drive in drives] == ["kitti/0000", "boreas/boreas-objects-v1"]
    worlds = budget_worlds(recorded=drives, without_streets=True)
    # KITTI labels what its front camera sees.
    assert worlds == {RECORDED: drives[1:], AHEAD: drives[:1]}
    assert [*budget_worlds(recorded=drives)] == [STREETS, RECORDED, AHEAD]
    entry = Entry("care", cell_order="core-spread")
    tasks = budget_tasks(entry, RECORDED, drives, "megvii")
    assert [len(task) for task in tasks] == [1 + len(BUDGETS)] * 2
    for drive, (full, *own) in zip(drives, tasks, strict=True):
        assert {(config.source, config.scene) for config in (full, *own)} == {drive}
        assert (full.policy, full.budget) == ("full", 1.0)
        assert [config.budget for config in own] == [*BUDGETS]
        assert {(each.policy, each.cell_order) for each in own} == {("care", "core-spread")}
        assert {each.camera_profile for each in own} == {"kitti"}
        assert {each.camera_latency_s for each in own} == {0.0}
        assert {each.detector for each in (full, *own)} == {"megvii"}


def test_drives_of_one_name_are_refused(tmp_path):
    for folder in ("one", "other"):
        kitti_drive.write(tmp_path / folder)
    with pytest.raises(InvalidInput, match="kitti/0000 twice"):
        recorded_drives([f"kitti:{tmp_path}/one", f"kitti:{tmp_path}/other"])
    # A source that is given twice plays once.
    assert len(recorded_drives([f"kitti:{tmp_path}/one"] * 2)) == 1


def test_a_file_holds_streets_and_drives(tmp_path, monkeypatch):
    monkeypatch.setattr(result_files, "_REFERENCES", tmp_path / "references")
    result = made_budgets("care", HALF_WAY, recorded=["kitti/0000", "boreas/b"], later=NEVER)
    wider = made_budgets("care", HALF_WAY, recorded=["kitti/0000", "kitti/0001"])
    result.write(tmp_path / "mine.json")
    # All drives of a published source are played, or none.
    result_files.publish_references([wider])
    with pytest.raises(InvalidInput, match="lacks the recorded drive kitti/0001"):
        read_result(tmp_path / "mine.json")
    # They are the same under every detector.
    replace(result, detector="megvii").write(tmp_path / "other.json")
    with pytest.raises(InvalidInput, match="lacks the recorded drive kitti/0001"):
        read_result(tmp_path / "other.json")
    result_files.publish_references([result])
    assert read_result(tmp_path / "mine.json") == result
    content = json.loads((tmp_path / "mine.json").read_text())
    assert [*content["counts"]] == ["streets", "recorded ahead", "recorded"]
    assert content["b90_percent"][0] == "never"
    assert content["held_back_by"] == "recorded ahead: emerging, 50.0% at 20% (+7)"
    assert result.of_part(STREETS).score.budget < 0.03
    assert result.of_part(AHEAD).worlds == ((AHEAD, "kitti/0000"),)


def test_what_holds_an_entry_back_names_the_part_where_there_are_several():
    curves = ALWAYS, ALWAYS, HALF_WAY, ALWAYS
    drives = [f"boreas/{n}" for n in range(2)]
    one = made_budgets("care", *curves)
    assert one.held_back_by == "kept"
    assert made_budgets("care", *curves, recorded=drives).held_back_by == "streets: kept"
    late = made_budgets("care", *curves, recorded=drives, later=NEVER)
    assert late.held_back_by == "recorded: emerging, 50.0% at 20% (+3)"
    assert made_budgets("care", *[ALWAYS] * 4).held_back_by == ""
    # If several never get there, the farthest one is named.
    low, lower = ([0.0] * 6 + [share] for share in (0.8, 0.6))
    assert made_budgets("care", low, ALWAYS, lower, low).held_back_by == "kept, 60.0% at 20% (+2)"


def test_entries_share_the_full_scan():
    (one, *_), (other, *_) = (
        budget_tasks(Entry(name), STREETS, [200], "centerpoint")[0] for name in ("care", "boxes")
    )
    assert one == other


@pytest.mark.parametrize("quick", [True, False])
def test_a_result_holds_the_counts_and_the_times_of_its_plays(tmp_path, quick):
    """The median of 1 to 7 ms is 4. The full scan's 99 ms and the tests have no part in it."""
    worlds = {STREETS: [200, 201, 202], TESTS: budget_worlds(closed_loop=True)[TESTS][:1]}
    entry = Entry("care")
    with made_plays(tmp_path) as player:
        (result,) = play_budgets([entry], player, "centerpoint", worlds, quick)
    given = {"quick": quick, "policy_ms": (4.0, 40.0), "made_by": made_by(entry)}
    assert result.of_part(STREETS) == made_budgets(entry, HALF_WAY, streets=3, **given)
    (test,) = result.of_part(TESTS).rows
    assert (test.full, test.got) == ((1.0, 0.0), ((0.0, 0.0),) * len(BUDGETS))


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
