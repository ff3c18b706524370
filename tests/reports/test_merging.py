"""Folders of one study in one: what is kept, what is compared, and what is refused."""

import json
import math
import re
from unittest.mock import Mock

import pyarrow.parquet as pq
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.reports.merging import merged
from care_sim.reports.report import StudyReport, read_results
from care_sim.sources.scenes import Streets
from care_sim.study.play_config import play_grid
from care_sim.study.results_formats import PLAYS
from care_sim.study.rows.parquet import read_rows, write_columns, write_rows
from care_sim.study.rows.reading import policy_of
from care_sim.study.scene_play import play_scene
from tests.helpers.made_rows import rows

OURS = rows("care", [15.0, 16.0])
FULL = rows("full", [17.0, 18.0])
THEIRS = rows("history", [4.0, None])


def folder(path, held, study="sweep", code="one"):
    """A folder of results with these rows, played by some code."""
    path.mkdir()
    write_rows(held, path / "episodes.parquet", study)
    (path / "config.json").write_text(json.dumps({"versions": {"code": code}}))
    return path


def merge(capsys, *arguments):
    """Exit code, output and errors."""
    with pytest.raises(SystemExit) as end:
        main(["report", *map(str, arguments)])
    return end.value.code, *capsys.readouterr()


def test_policies_of_two_folders_are_compared_and_regret_is_worked_out(tmp_path, capsys):
    ours, theirs = folder(tmp_path / "ours", OURS), folder(tmp_path / "theirs", [*THEIRS, *FULL])
    code, out, err = merge(capsys, ours, theirs, "--out", tmp_path / "both", "--verbose")
    assert (code, err) == (0, "")
    assert "dense: care minus each policy" in out
    assert read_results(tmp_path / "both")[1].name == "sweep"
    # The full scan of the other folder is the bound of both.
    found = read_rows(tmp_path / "both" / "episodes.parquet")
    assert [row["regret_m"] for row in found if row["policy"] == "care"] == [2.0, 2.0]
    config = json.loads((tmp_path / "both" / "config.json").read_text())
    assert [*config["merged"]] == ["ours", "theirs"]


def test_a_task_of_both_folders_is_kept_once(tmp_path, capsys):
    ours = folder(tmp_path / "ours", [*OURS, *FULL])
    theirs = folder(tmp_path / "theirs", [*THEIRS, *FULL], code="another")
    code, out, err = merge(capsys, ours, theirs, "--out", tmp_path / "both")
    # The full scan in both shows that the worlds of two versions of the code are the same.
    assert (code, err) == (0, "")
    assert "Alike in two of the folders, and kept once: 2 episodes\n" in out
    assert len(read_results(tmp_path / "both")[0]) == 6


def test_any_policy_can_be_held_against_the_others(tmp_path, capsys):
    held = folder(tmp_path / "held", [*OURS, *THEIRS, *FULL])
    before = sorted(held.iterdir())
    code, out, err = merge(capsys, held, "--minus", "care")
    assert (code, err) == (0, "")
    assert "dense: care minus each policy" in out
    # 15 and 16 m less 17 and 18 m.
    assert re.search(r"full +-2\.0 \[-2\.0,-2\.0\]", out)
    assert sorted(held.iterdir()) == before


def test_tables_are_printed_where_nothing_can_be_written(tmp_path, capsys, monkeypatch):
    held = folder(tmp_path / "held", [*OURS, *FULL])
    error = PermissionError(13, "Permission denied", str(held / "tables.md"))
    monkeypatch.setattr(StudyReport, "write", Mock(side_effect=error))
    code, out, err = merge(capsys, held)
    assert "First detection: median, m" in out
    assert f"care-sim: tables and figures in {held} are not written anew: " in err
    assert (code, err.count("\n")) == (1, 1)


def test_a_policy_that_was_not_played_has_no_differences(tmp_path, capsys):
    held = folder(tmp_path / "held", OURS)
    code, _, err = merge(capsys, held, "--minus", "car")
    assert (code, err.endswith("; the nearest is care; known: care\n")) == (2, True)
    assert "nothing that care can be compared with" in merge(capsys, held, "--minus", "care")[2]
    both = folder(tmp_path / "both", [*OURS, *FULL])
    assert "full has a budget of its own" in merge(capsys, both, "--minus", "full")[2]
    ablated = folder(tmp_path / "ablated", [*OURS, *FULL], study="ablate")
    assert "study ablate has no tables" in merge(capsys, ablated, "--minus", "care")[2]
    assert "no meaning with --page" in merge(capsys, held, "--minus", "care", "-o", "x.html")[2]


def test_a_folder_that_nothing_links_is_told_though_others_share_a_task(tmp_path):
    ours = folder(tmp_path / "ours", [*OURS, *FULL])
    theirs = folder(tmp_path / "theirs", [*THEIRS, *FULL], code="another")
    third = folder(tmp_path / "third", rows("random", [9.0, 9.0]), code="a third")
    unknown = folder(tmp_path / "unknown", rows("fan", [9.0, 9.0]))
    (unknown / "config.json").unlink()
    assert merged([ours, theirs, third, unknown]).apart == [third, unknown]
    # Merged rows are of the code of their parts.
    merged([ours, theirs]).write(tmp_path / "both")
    later = folder(tmp_path / "later", rows("random", [9.0, 9.0]), code="another")
    assert merged([tmp_path / "both", later]).apart == []


def test_columns_come_in_one_order_and_of_one_type(tmp_path):
    one = [row | {"policy.b": 2, "policy.x": 1, "own": math.nan} for row in OURS]
    other = [row | {"policy.x": 1, "policy.b": 2, "own": math.nan} for row in OURS]
    later = [row | {"seed": 7} for row in other[:1]]
    whole = merged([folder(tmp_path / "one", one), folder(tmp_path / "two", [*other, *later])])
    # Equal rows are one, what is no number in them included, and their policy has one name.
    assert (whole.twice, len(whole.rows)) == (2, 3)
    assert {policy_of(row) for row in whole.rows} == {"care b=2 x=1"}
    text = folder(tmp_path / "text", [row | {"own": "text"} for row in THEIRS])
    with pytest.raises(InvalidInput, match="the column own has values of different types"):
        merged([tmp_path / "one", text])


def test_nothing_is_written_over(tmp_path, capsys):
    ours, theirs = folder(tmp_path / "ours", OURS), folder(tmp_path / "theirs", THEIRS)
    code, _, err = merge(capsys, ours, theirs, "--out", ours)
    assert (code, err.endswith("is there already and not empty: give another --out\n")) == (2, True)
    told = merge(capsys, ours, "--out", tmp_path / "out")[2]
    assert "--out is for several folders; the report of one stays in it" in told
    assert len(read_results(ours)[0]) == 2


@pytest.fixture(scope="module")
def played():
    """Rows of one generated street under two policies and the full scan."""
    configs = play_grid(Streets(), Streets().scenes()[:1], ["care", "history", "full"], [0.05])
    return dict(zip(("care", "history", "full"), play_scene(configs), strict=True))


def plays(path, held):
    """A folder of the protocol with these rows."""
    path.mkdir()
    write_rows(PLAYS.kept_rows(held), path / PLAYS.file, "protocol")
    for name, columns in PLAYS.further_files(held).items():
        write_columns(columns, path / name)
    return path


def test_events_of_the_open_loop_go_with_their_plays(tmp_path, played, capsys):
    ours = plays(tmp_path / "ours", [played["care"], played["full"]])
    theirs = plays(tmp_path / "theirs", [played["full"], played["history"]])
    whole = merged([ours, theirs])
    assert (whole.twice, whole.apart) == (1, [])
    whole.write(tmp_path / "both")
    held = pq.read_table(tmp_path / "both" / "events.parquet")
    together = plays(tmp_path / "together", [played[n] for n in ("care", "full", "history")])
    assert "history minus" in merge(capsys, tmp_path / "both", "--minus", "history")[1]
    assert held.equals(pq.read_table(together / "events.parquet"))


def test_what_not_all_folders_hold_of_a_play_is_left_out(tmp_path, played):
    ours = plays(tmp_path / "ours", [played["care"]])
    lacking = {n: v for n, v in played["history"].items() if not n.startswith("entry/emergence")}
    theirs = plays(tmp_path / "theirs", [lacking])
    (theirs / "events.parquet").unlink()
    merged([ours, theirs]).write(tmp_path / "both")
    assert not (tmp_path / "both" / "events.parquet").exists()
    assert len(read_results(tmp_path / "both")[0]) == 2
