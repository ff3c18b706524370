from dataclasses import asdict

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.loops.records import Outcome
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows, write_rows

NO_IMPACT = (False, None, None, None)
ROWS = [
    EpisodeConfig("dense", policy).row()
    | asdict(Outcome(distance, 3.0, True, None, 2.5, False, None, 98280, *NO_IMPACT))
    for policy, distance in (("history", None), ("care", 1 / 3))
]


def test_rows_come_back_as_written(tmp_path):
    rows = [ROWS[0] | {"scenario.vehicles": 7}, ROWS[1] | {"scenario.gap_m": (0.5, 0.6)}]
    write_rows(rows, tmp_path / "episodes.parquet")
    first, second = read_rows(tmp_path / "episodes.parquet")
    assert first == rows[0] | {"scenario.gap_m": None}
    assert second == rows[1] | {"scenario.vehicles": None, "scenario.gap_m": (0.5, 0.6)}
    assert [path.name for path in tmp_path.iterdir()] == ["episodes.parquet"]


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1 not a table PAR1"])
def test_a_damaged_file_is_named(content, tmp_path):
    path = tmp_path / "episodes.parquet"
    path.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"episodes\.parquet is not a readable Parquet file"):
        read_rows(path)


def test_a_file_of_something_else_is_named(tmp_path):
    write_rows([{"apples": 3}], tmp_path / "episodes.parquet")
    with pytest.raises(InvalidInput, match=r"it lacks .*policy"):
        read_rows(tmp_path / "episodes.parquet", EPISODES.schema)
