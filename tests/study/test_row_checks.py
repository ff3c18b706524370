"""Rows that are missing, written twice or of a newer version are named by `report` and `merge`."""

import json

import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.reports.merging import merged
from care_sim.reports.report import read_results
from care_sim.study.episode_config import grid
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_rows import row

CONFIGS = grid(["dense", "dartout"], ["care", "full"], [0.03, 0.1], [0, 1, 2], ego_speed_sigma=0.5)
ROWS = [row(config, 15.0 + config.seed) for config in CONFIGS]


def folder(path, rows, **description):
    write_rows(rows, path / EPISODES.file)
    listed = EPISODES.listed(CONFIGS) | {"failed": []} | description
    (path / "config.json").write_text(json.dumps(listed))
    return path


def test_all_rows_of_the_list_leave_no_doubt(tmp_path):
    rows, _, left_out = read_results(folder(tmp_path, ROWS))
    assert (rows, left_out) == (ROWS, [])


def test_a_row_that_is_missing_is_named(tmp_path):
    lacking = folder(tmp_path / "one", ROWS[:-1])
    told = "1 row that config.json lists, the first dartout full 1.0 seed 2"
    assert read_results(lacking)[2] == [told]
    # The other folder may hold the missing row.
    assert merged([lacking, folder(tmp_path / "two", ROWS[:1])]).left_out == [told]
    assert merged([lacking, folder(tmp_path / "three", ROWS)]).left_out == []


def test_a_task_that_failed_is_named_once(tmp_path):
    failed = folder(tmp_path, ROWS[:-1], failed=["dartout full 1 seed 2: it broke"])
    assert read_results(failed)[2] == []


def test_a_row_that_was_written_twice_counts_once(tmp_path):
    rows, _, left_out = read_results(folder(tmp_path, [*ROWS, ROWS[3]]))
    assert (rows, left_out) == (ROWS, ["1 row written twice"])


def test_two_rows_of_one_task_must_be_alike(tmp_path):
    folder(tmp_path, [*ROWS[1:], ROWS[3] | {"rays_fired": 7}])
    with pytest.raises(InvalidInput, match=r"dense care 0\.1 came out differently in .*rays_fired"):
        read_results(tmp_path)


def test_columns_of_a_newer_version_are_named(tmp_path):
    foggy = folder(tmp_path / "one", [each | {"fog": 0.5, "version": "9.9.0"} for each in ROWS])
    told = (
        f"rows of care-sim 9.9.0 have columns that this version, {care_sim.__version__}, does not "
        "know: fog; rows that differ in them are counted together"
    )
    assert read_results(foggy)[2] == [told]
    assert merged([foggy, foggy]).left_out == [told]
