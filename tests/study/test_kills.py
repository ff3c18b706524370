"""Studies that are killed or interrupted: no process is left, no row is lost, the same command goes
on.
"""

import json
import os
import signal
import sys

import pytest

from care_sim.study.journal import JOURNAL
from tests.helpers.descendants import Marked, until

COMMAND = [
    sys.executable,
    "-c",
    "import sys; sys.argv[0] = 'care-sim'; from care_sim.cli import main; main()",
]
STARTS = """
import signal, sys, time
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
    signal.signal(number, lambda *_: None)
from care_sim.study.executors import processes
print("starts", flush=True)
with processes(2) as pool:
    print(*pool.map(abs, range(-3, 0)), flush=True)
"""


def study(folder):
    axes = ["--scenarios", "dartout", "--policies", "random", "--seeds", "800", "--workers", "2"]
    return [
        *COMMAND,
        "sweep",
        *axes,
        "--scenario-parameters",
        "duration_s=0.1",
        "--out",
        str(folder),
    ]


def rows(folder):
    journal = folder / JOURNAL
    return journal.read_text().splitlines()[:-1] if journal.exists() else []


def test_whatever_ends_a_study_leaves_no_process_and_the_same_command_goes_on(tmp_path):
    kept = []
    for end in (signal.SIGKILL, signal.SIGHUP, signal.SIGQUIT):
        with Marked(study(tmp_path)) as started:
            enough = len(kept) + 3
            assert until(lambda enough=enough: len(rows(tmp_path)) >= enough, 60)
            assert len(started.alive()) >= 4
            os.kill(started.process.pid, end)
            assert started.all_end_within(30), end
            complaint = started.process.communicate()[1]
        assert rows(tmp_path)[: len(kept)] == kept
        kept = rows(tmp_path)
        if end != signal.SIGKILL:
            assert started.process.returncode == 130
            assert complaint.splitlines()[-1].startswith(
                "care-sim: interrupted; what is finished is kept"
            )
            assert "Traceback" not in complaint
    digests = [json.loads(line)["digest"] for line in kept]
    assert len(set(digests)) == len(digests)


@pytest.mark.parametrize("policy", ["starts-thread", "forks"])
def test_a_study_ends_whatever_a_policy_has_started(policy, third_party, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(third_party), prepend=os.pathsep)
    options = ["--policies", policy, "--budgets", "0.1", "--seeds", "2", "--workers", "2"]
    short = ["--scenarios", "dartout", "--scenario-parameters", "duration_s=0.3"]
    out = tmp_path / "out"
    with Marked([*COMMAND, "sweep", *options, *short, "--out", str(out)]) as started:
        assert until(lambda: started.process.poll() is not None, 60)
        assert started.all_end_within(10)
        assert started.process.returncode == 0
        assert "reset" in started.process.communicate()[0]
    assert (out / "tables.md").is_file()


def test_the_fork_server_and_its_workers_do_not_hear_the_terminal_while_they_start():
    with Marked([sys.executable, "-c", STARTS]) as started:
        started.process.stdout.readline()

        def disturbed():
            for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
                os.killpg(started.process.pid, number)
            return started.process.poll() is not None

        assert until(disturbed, 60)
        assert started.process.communicate() == ("3 2 1\n", "")
