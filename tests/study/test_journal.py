"""Only one study writes to a journal, and a crash leaves nothing that keeps the next one out."""

import subprocess
import sys

import pytest

from care_sim.errors import InvalidInput
from care_sim.study.journal import Journal

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
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout.readline() == "open\n"
        with pytest.raises(InvalidInput, match=f"another study writes to {tmp_path} now; wait for its end or give"):
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
