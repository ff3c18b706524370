"""Rows that are written twice or of a newer version are named by `report` and `merge`."""

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


def folder(path, rows):
    write_rows(rows, path / EPISODES.file)
    return path


def test_a_row_that_was_written_twice_counts_once(tmp_path):
    assert read_results(folder(tmp_path, ROWS))[::2] == (ROWS, [])
    assert read_results(folder(tmp_path, [*ROWS, ROWS[3]]))[::2] == (ROWS, ["1 row written twice"])


def test_two_rows_of_one_task_must_be_alike(tmp_path):
    for column in ("rays_fired", "detection_distance_m"):
        folder(tmp_path, [*ROWS[1:], ROWS[3] | {column: 7}])
        with pytest.raises(InvalidInput, match=rf"dense care 0\.1 came out differently .*{column}"):
            read_results(tmp_path)
    # The version, the time that it took, and columns worked out beside the other rows may differ.
    folder(tmp_path, [*ROWS, ROWS[3] | {"wall_s": 7.0, "version": "0.1.0"}])
    assert len(read_results(tmp_path)[0]) == len(ROWS)


def test_columns_of_a_newer_version_are_named(tmp_path):
    foggy = folder(tmp_path / "one", [each | {"fog": 0.5, "version": "9.9.0"} for each in ROWS])
    told = (
        f"rows of care-sim 9.9.0 have columns that this version, {care_sim.__version__}, does not "
        "know: fog; rows that differ in them are counted together"
    )
    assert read_results(foggy)[2] == [told]
    assert merged([foggy, foggy]).left_out == [told]
    # The benchmark reads these.
    expected = folder(tmp_path / "two", [each | {"expected/emerging": 0.5} for each in ROWS])
    assert read_results(expected)[2] == []
