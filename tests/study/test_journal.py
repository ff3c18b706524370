"""Only one study writes to a journal, a crash leaves nothing that keeps the next one out, and a
folder tells of a study that has begun and not ended.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.report import next_steps, read_results
from care_sim.reports.studies import SWEEP
from care_sim.study.episode_config import grid
from care_sim.study.journal import JOURNAL, UNFINISHED, Journal, _checksum, describe_progress

HOLDS_AND_DIES = """
import os, signal, sys
from pathlib import Path
from care_sim.study.journal import Journal
journal = Journal(Path(sys.argv[1]))
journal.append({"digest": "a"})
print("open", flush=True)
sys.stdin.read()
"""


def test_a_second_study_is_refused_while_the_first_lives_and_not_after_it_was_killed(tmp_path):
    path = tmp_path / "journal.jsonl"
    command = [sys.executable, "-c", HOLDS_AND_DIES, str(path)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as first:
        assert first.stdout.readline() == "open\n"
        with pytest.raises(
            InvalidInput, match=f"another study writes to {tmp_path} now; wait for its end or give"
        ):
            Journal(path)
        first.kill()
    with Journal(path) as journal:
        assert "a" in journal
    with Journal(path) as journal:
        assert len(journal) == 1


def test_a_file_system_without_locks_will_do(tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(37, "No locks available")

    monkeypatch.setattr("fcntl.flock", no_locks)
    with Journal(tmp_path / "journal.jsonl") as journal:
        journal.append({"digest": "a"})
        assert "a" in journal


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_a_journal_that_is_a_link_is_refused_and_its_target_stays(link, tmp_path):
    (tmp_path / "theirs").write_text("theirs")
    link(tmp_path / "journal.jsonl", tmp_path / "theirs")
    with pytest.raises(InvalidInput, match=r"journal\.jsonl is a link, .*: remove it first"):
        Journal(tmp_path / "journal.jsonl")
    assert (tmp_path / "theirs").read_text() == "theirs"


ROW = {
    "digest": "a",
    "seed": 3,
    "detection_distance_m": 16.25,
    "scenario.gap_m": (0.5, 0.6),
    "policy": "care",
}


def written(path):
    with Journal(path, "paper") as journal:
        journal.append(ROW)
        journal.append(ROW | {"digest": "b"})
    return path.read_bytes()


def test_rows_come_back_with_their_study(tmp_path):
    path = tmp_path / "journal.jsonl"
    written(path)
    with Journal(path) as journal:
        assert (journal["a"], journal["b"]["digest"]) == (ROW, "b")
        assert (journal.studies, journal.damaged) == ({"paper"}, 0)


@given(place=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_no_flipped_bit_gives_another_row(tmp_path_factory, place, bit):
    path = tmp_path_factory.mktemp("flipped") / "journal.jsonl"
    content = bytearray(written(path))
    place %= len(content)
    content[place] ^= 1 << bit
    path.write_bytes(content)
    with Journal(path) as journal:
        kept = [journal[digest] for digest in "ab" if digest in journal]
        assert kept == [ROW | {"digest": row["digest"]} for row in kept]
        assert len(kept) == len(journal) < 2
        assert journal.damaged >= 1


def line(text):
    """A line of this text with the checksum that it should have."""
    return f'{text}, "check": "{_checksum(text)}"}}'.encode()


@pytest.mark.parametrize(
    "damaged",
    [
        b"\xff\xfe",
        b"[1]",
        b'{"digest": "old", "seed": 1}',
        b'{"digest": "a", "study": "sweep", "check": "0123456789abcdef"}',
        line('{"study": "sweep"'),
        line('{"digest": ["a"], "study": "sweep"'),
        line('{"digest": "deep", "study": "sweep", "x": ' + "[" * 9999),
    ],
)
def test_a_line_of_anything_else_is_passed_over_and_counted(tmp_path, damaged):
    path = tmp_path / "journal.jsonl"
    path.write_bytes(damaged + b"\n")
    written(path)
    with Journal(path) as journal:
        assert (len(journal), journal.damaged) == (2, 1)


def test_a_torn_line_is_closed_before_the_next_row(tmp_path):
    path = tmp_path / "deep" / "journal.jsonl"
    written(path)
    path.write_text(path.read_text()[:-9])
    with Journal(path) as journal:
        assert "a" in journal
        assert "b" not in journal
        journal.append({"digest": "c", "x": 1 / 3})
    with Journal(path) as journal:
        assert (journal["a"], journal["c"]["x"]) == (ROW, 1 / 3)


def short(seeds=(0,)):
    return grid(["dartout"], ["history"], [0.1], seeds, scenario_parameters=(("duration_s", 0.1),))


def stopped(configs, played, folder, command, monkeypatch):
    """A study of which somebody stopped all but the first tasks."""

    def few(configs, *arguments):
        run(configs[:played], *arguments)
        raise KeyboardInterrupt

    import care_sim.commands.shared.run_study as module

    run = module.run_with_progress
    monkeypatch.setattr(module, "run_with_progress", few)
    with pytest.raises(KeyboardInterrupt):
        run_study(configs, folder, workers=1, command=command)
    monkeypatch.undo()


def test_a_folder_tells_how_far_its_study_is_and_how_to_go_on(tmp_path, monkeypatch):
    assert describe_progress(tmp_path) == ""
    configs, command = short(range(3)), "care-sim sweep --seeds 3"
    stopped(configs, 2, tmp_path, command, monkeypatch)
    told = f"{tmp_path} holds an unfinished study, sweep: 2 of 3 episodes are played"
    with pytest.raises(InvalidInput) as refused:
        read_results(tmp_path)
    assert str(refused.value) == f"{told}; to go on: {command}"
    with Journal(tmp_path / JOURNAL):
        assert describe_progress(tmp_path) == f"{told}, and it is being played now"
    # A note that is lost or damaged.
    note = (tmp_path / UNFINISHED).read_text()
    for text in ("{", "[]", '{"study": 3}', note.replace('"others": 0', '"others": "0"')):
        (tmp_path / UNFINISHED).write_text(text)
        assert describe_progress(tmp_path) == (
            f"{tmp_path} holds an unfinished study, 2 rows; run again the command that began it"
        )
    assert run_study(configs, tmp_path, workers=1) == []
    assert not (tmp_path / UNFINISHED).exists()


def test_rows_of_other_options_do_not_count(tmp_path, monkeypatch):
    run_study(short((7,)), tmp_path, workers=1)
    stopped(short((7, 8, 9)), 2, tmp_path, "again", monkeypatch)
    assert "2 of 3 episodes are played; to go on: again" in describe_progress(tmp_path)
    # Results of before are shown, with a line that not all is there.
    assert len(read_results(tmp_path)[0]) == 1
    (said,) = (one for one in next_steps(tmp_path, SWEEP) if one.startswith("Not all of it"))
    assert "2 of 3" in said
