"""Only one study writes to a journal, and a crash leaves nothing that keeps the next one out."""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.study.journal import Journal, _line

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


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\xfe",
        b"[1]",
        b"3",
        b'{"no": 1}',
        b'{"digest": "old", "seed": 1}',
        b"[" * 100_000,
        b'{"digest": "a", "study": "sweep", "check": "0123456789abcdef"}',
        _line({"study": "sweep"}).rstrip().encode(),
        _line({"digest": ["a"], "study": "sweep"}).rstrip().encode(),
        _line({"digest": "deep", "study": "sweep", "x": 0})
        .rstrip()
        .encode()
        .replace(b'"x": 0', b'"x": ' + b"[" * 9999),
    ],
)
def test_a_line_of_anything_else_is_passed_over_and_counted(tmp_path, line):
    path = tmp_path / "journal.jsonl"
    path.write_bytes(line + b"\n")
    written(path)
    with Journal(path) as journal:
        assert (len(journal), journal.damaged) == (2, 1)
