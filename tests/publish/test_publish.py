"""Publishing anew: the command, what is replaced, what is printed."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from care_sim.study.provenance import code_digest
from tests.golden import published as golden
from tests.publish import __main__ as publish

COMMAND = "care-sim sweep --policies care --scenarios dartout --budgets 0.1 --seeds $(seq 3 4)"


def test_a_command_gets_its_seeds_and_recordings(tmp_path):
    (tmp_path / "kitti-tracking").mkdir()
    line = "care-sim protocol --source kitti:FOLDER --seeds $(seq 8 10) --policies mine:Mine"
    assert publish.words_of(line, None) is None
    assert publish.words_of(line, tmp_path / "elsewhere") is None
    assert publish.words_of(line, tmp_path) == [
        *("-m", "care_sim", "protocol", "--source", f"kitti:{tmp_path.resolve()}/kitti-tracking"),
        *("--seeds", "8", "9", "10", "--policies", "mine:Mine"),
    ]


@pytest.mark.parametrize(
    ("after", "changed"),
    [
        ("| care | 11.2 [0.3,22.0] | fan |", False),
        ("| care | 10.2 [-0.3,22.0] | fan |", True),
        ("| care | **10.2 [0.3,22.0]** | fan |", True),
        ("| care | 10.2 [0.3,22.0] | place |", True),
    ],
    ids=["numbers", "an interval with 0", "bold", "another control"],
)
def test_lines_are_shown_for_more_than_their_numbers(after, changed):
    before = "| care | 10.2 [0.3,21.0] | fan |"
    head, tail = "| policy | m | control |\n", "\n| all | 1 | 2 |"
    found = list(publish.changed_lines(head + before + tail, head + after + tail))
    assert found == [f"- {before}", f"+ {after}"] * changed


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A published folder of one row, beside nothing else."""
    data = tmp_path / "data"
    monkeypatch.setattr(publish, "PUBLISHED", data)
    monkeypatch.setattr(golden, "PUBLISHED", data)
    monkeypatch.setattr(golden, "FILE", tmp_path / "golden.parquet")
    monkeypatch.setattr(publish, "write_index", lambda: None)
    place = data / "tiny"
    place.mkdir(parents=True)
    config = {"command": COMMAND, "versions": {"code": "before"}}
    (place / "config.json").write_text(json.dumps(config))
    pq.write_table(pa.table({"episode_hash": ["a"], "wall_s": [60.0]}), place / "episodes.parquet")
    (place / "tables.md").write_text("no table\n")
    (place / "lost.svg").write_text("a figure of before")
    golden.write_golden([golden.Cell("tiny", "t", "", ("a",), "b", ("1",))])
    return place


def test_a_folder_is_played_again_and_replaced_whole(folder, tmp_path, capfd):
    assert publish.main(["--list"]) == 0
    assert capfd.readouterr().out == "tiny: 1 rows, 1.0 minutes\n"
    line = ["tiny", "--work", str(tmp_path / "work"), "--workers", "1"]

    # A published figure that is no longer drawn: nothing is replaced.
    assert publish.main(line) == 1
    assert "has no lost.svg" in capfd.readouterr().out
    assert pq.read_metadata(folder / "episodes.parquet").num_rows == 1

    # The plays of the first time are not played again.
    (folder / "lost.svg").unlink()
    assert publish.main(line) == 0
    told = capfd.readouterr()
    assert "2 of 2 episodes found" in told.err
    assert "tiny: 2 of 2 rows differ; there were 1\n  - no table\n  + " in told.out
    config = json.loads((folder / "config.json").read_text())
    assert config["command"] == COMMAND
    assert config["versions"]["code"] == code_digest()
    assert {path.name for path in folder.iterdir()} == {
        *("config.json", "episodes.parquet", "tables.md")
    }
    made = Path(tmp_path / "work" / code_digest() / "tiny")
    assert (folder / "tables.md").read_bytes() == (made / "tables.md").read_bytes()
    assert [*golden.read_golden()["tiny"]] == golden.cells_of("tiny") != []

    assert publish.main(line) == 0
    assert capfd.readouterr().out == "tiny: published with this code\n"


def test_b90_is_played_with_all_recordings(tmp_path, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(publish, "run", lambda words: asked.extend(map(str, words)) or 0)
    assert publish.main(["b90"]) == 1
    assert "give --data" in capsys.readouterr().out
    assert publish.main(["b90", "--data", str(tmp_path), "--workers", "1"]) == 0
    words = " ".join(asked)
    recorded = [f"{kind}:{tmp_path.resolve()}/{name}" for kind, name in publish.RECORDINGS.items()]
    assert f"docs/b90_results.py --recorded {' '.join(recorded)} boreas --plays " in words
    assert words.endswith("b90 --workers 1")
