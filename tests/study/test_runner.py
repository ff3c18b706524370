"""Real episodes in real processes, short ones."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import pytest

from care_sim.commands.shared.run_study import run_study
from care_sim.loops.records import Outcome
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.episode_play import run_episode, trace
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.provenance import code_digest
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows
from care_sim.study.runner import RunListener, in_batches, run_all

SHORT = (("duration_s", 0.3),)
MEASURED = {"wall_s", "peak_rss_mb"}


def short(policies, seeds=(0,), budgets=(0.1,)):
    return grid(["dartout"], policies, budgets, seeds, scenario_parameters=SHORT)


def steady(row):
    return {name: value for name, value in row.items() if name not in MEASURED}


def test_an_episode_is_one_tidy_row():
    config = EpisodeConfig("dartout", "care", seed=3, scenario_parameters=SHORT)
    row, keyframes = trace(config)
    assert set(config.row()) | set(Outcome.__dataclass_fields__) < set(row)
    assert (row["keyframes"], row["digest"], row["rays_fired"]) == (3, config.digest(), 3 * 1638)
    assert len(keyframes) == 3
    assert 0 < row["wall_s"] < 60
    assert row["peak_rss_mb"] > 50


def test_the_hash_tells_episodes_apart_and_repeats():
    a, b = (run_episode(config) for config in short(["care"], seeds=(0, 1)))
    assert a["episode_hash"] != b["episode_hash"]
    assert steady(run_episode(short(["care"])[0])) == steady(a)
    street = [
        EpisodeConfig("dense", policy, scenario_parameters=SHORT) for policy in ("care", "random")
    ]
    assert len({run_episode(config)["episode_hash"] for config in street}) == 2


def test_a_study_writes_its_files_and_equals_the_same_episodes_at_home(tmp_path):
    configs = short(["history", "full"], budgets=(0.05, 0.1))
    assert run_study(configs, tmp_path, workers=2) == []
    rows = read_rows(tmp_path / EPISODES.file)
    assert [row["digest"] for row in rows] == [config.digest() for config in configs]
    assert rows[0]["episode_hash"] == run_episode(configs[0])["episode_hash"]
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"config.json", JOURNAL, EPISODES.file, "tables.md", "tables.tex"}


def test_an_interrupted_study_loses_and_repeats_nothing(tmp_path):
    configs = short(["history", "care", "random"])
    run_study(configs[:2], tmp_path, workers=1)
    path = tmp_path / JOURNAL
    first, second = path.read_text().splitlines()
    path.write_text(f"{first}\n{second[:40]}")
    assert run_study(configs, tmp_path, workers=1) == []
    lines = path.read_text().splitlines()
    assert lines[0] == first
    assert len(lines) == 4
    assert len(read_rows(tmp_path / EPISODES.file)) == 3


def test_a_finished_study_is_not_written_again(tmp_path, monkeypatch):
    configs = short(["history"], seeds=range(3))
    run_study(configs, tmp_path, 1, ThreadPoolExecutor)
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    # Hashing the code for every task took most of the time before a large study went on.
    hashed = Mock(wraps=code_digest)
    monkeypatch.setattr("care_sim.study.run_config.code_digest", hashed)
    assert run_study(configs, tmp_path, 1, ThreadPoolExecutor) == []
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == before
    hashed.assert_not_called()
    (tmp_path / "tables.md").unlink()
    run_study(configs, tmp_path, 1, ThreadPoolExecutor)
    assert (tmp_path / "tables.md").is_file()


class Counting(RunListener):
    def __init__(self):
        self.ended = []

    def finished(self, config, row):
        self.ended.append((config, row is not None))


class Impatient(RunListener):
    """Interrupts once episodes are in flight."""

    def __init__(self):
        self.told, self.warned = 0, False

    def playing(self, workers):
        self.told += 1
        if self.told == 2:
            raise KeyboardInterrupt

    def interrupted(self):
        self.warned = True


def test_an_interrupt_finishes_and_keeps_what_is_in_flight(tmp_path):
    configs, listener = short(["history", "care", "random"], seeds=(0, 1)), Impatient()
    with Journal(tmp_path / JOURNAL) as journal:
        with pytest.raises(KeyboardInterrupt):
            run_all(configs, journal, 2, listener=listener)
        kept = [config for config in configs if config.digest() in journal]
    assert listener.warned
    assert len(kept) >= 2
    assert len(kept) < len(configs)


def test_episodes_are_played_seed_by_seed_and_written_in_the_order_asked(tmp_path):
    configs = short(["history", "history-oracle"], seeds=(0, 1, 2))
    run_study(configs, tmp_path, workers=1)
    played = [json.loads(line)["seed"] for line in (tmp_path / JOURNAL).read_text().splitlines()]
    # Episodes of history are one batch; those of a privileged policy are played one by one.
    assert played == [0, 1, 2, 0, 1, 2]
    assert [row["digest"] for row in read_rows(tmp_path / EPISODES.file)] == [
        config.digest() for config in configs
    ]


def test_pairs_of_policies_stand_together_as_far_as_batches_go():
    configs = short(["history", "random"], seeds=(0, 1, 2))
    batches = in_batches(configs, 2)
    assert [[(one.policy, one.seed) for one in batch] for batch in batches] == [
        [("history", 0), ("history", 1)],
        [("random", 0), ("random", 1)],
        [("history", 2)],
        [("random", 2)],
    ]


@pytest.mark.parametrize(
    ("most", "sizes"),
    [(16, [10, 5, 2, 1, 1, 1]), (8, [8, 6, 2, 2, 1, 1]), (1, [1] * 20), (None, [20])],
)
def test_the_last_tasks_are_shared_out_among_the_workers(tmp_path, most, sizes):
    played = []

    def refuse(batch):
        played.append(len(batch))
        return ["no"] * len(batch)

    configs = short(["history"], seeds=range(20))
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 2, ThreadPoolExecutor, play_batch=refuse, most=most)
    assert sorted(played, reverse=True) == sizes
    assert {failure.config for failure in failures} == {*configs}


def test_a_bad_policy_costs_only_its_own_episode(third_party, tmp_path):
    configs = short(["history", "dies", "care", "raises", "raises-oddly", "exits", "random"])
    listener = Counting()
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 2, listener=listener)
        kept = {config for config in configs if config.digest() in journal}
    assert {failure.config.policy: failure.reason for failure in failures} == {
        "dies": "the worker process died",
        "raises": "RuntimeError: no idea, at all (misbehaving.py, line 22)",
        "raises-oddly": "Odd: hard to unpickle (misbehaving.py, line 30)",
        "exits": "SystemExit: 4 (misbehaving.py, line 34)",
    }
    assert str(failures[0]).startswith(
        f"dartout {failures[0].config.policy} 0.1 seed 0 scenario.duration_s=0.3: "
    )
    assert {config.policy for config in kept} == {"history", "care", "random"}
    assert Counter(listener.ended) == Counter((config, config in kept) for config in configs)


def test_every_error_of_a_policy_is_one_short_line_with_its_place(third_party, tmp_path):
    configs = short(["raises-its-own", "raises-at-length"])
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 2)
    lines = {failure.config.policy: failure.reason for failure in failures}
    assert lines == {
        "raises-its-own": "Own: its own (misbehaving.py, line 86)",
        "raises-at-length": f"RuntimeError: {'x' * 300}... (misbehaving.py, line 98)",
    }


class Following(RunListener):
    """Keeps what it is told, in its order."""

    def __init__(self):
        self.told = []

    def finished(self, config, row):
        self.told.append((config.seed, row is not None))

    def failed(self, failure):
        self.told.append(failure.reason)


def test_a_failure_is_told_before_the_rest_is_played(tmp_path):
    def refuse_the_first(batch):
        return [
            config.row() | {"digest": config.digest()} if config.seed else "no" for config in batch
        ]

    listener = Following()
    with Journal(tmp_path / JOURNAL) as journal:
        run_all(
            short(["history"], seeds=range(3)), journal, 1, ThreadPoolExecutor, listener,
            refuse_the_first, most=1,
        )  # fmt: skip
    assert listener.told == [(0, False), "no", (1, True), (2, True)]


def test_a_worker_killed_in_mid_run_costs_a_retry(third_party, tmp_path):
    configs = short(["history", "killed-once", "care", "random"])
    listener = Counting()
    with Journal(tmp_path / JOURNAL) as journal:
        assert run_all(configs, journal, 2, listener=listener) == []
        assert len(journal) == 4
    assert (third_party.parent / "killed").exists()
    assert len((tmp_path / JOURNAL).read_text().splitlines()) == 4
    assert Counter(listener.ended) == Counter((config, True) for config in configs)


class BusyServer(ThreadPoolExecutor):
    """Fails to start a worker at the first call, as a pool whose fork server is busy or was killed
    does.
    """

    error: type[Exception]

    def submit(self, *call, **options):
        if not hasattr(self, "called"):
            self.called = True
            raise self.error
        return super().submit(*call, **options)


@pytest.mark.parametrize("error", [ConnectionRefusedError, EOFError])
def test_a_fork_server_that_fails_once_costs_nothing(tmp_path, error):
    server = type("Server", (BusyServer,), {"error": error})
    configs = short(["history"])
    assert run_study(configs, tmp_path, workers=1, make_executor=server) == []
    assert len(read_rows(tmp_path / EPISODES.file)) == 1


@pytest.mark.slow
def listen_to_interrupts():
    """A process that is started in the background inherits ignored interrupts."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_an_interrupt_keeps_what_was_computed(tmp_path):
    sweep = [
        "sweep",
        "--scenarios",
        "dartout",
        "--policies",
        "random",
        "--seeds",
        "500",
        "--workers",
        "1",
    ]
    options = ["--out", str(tmp_path), "--scenario-parameters", "duration_s=0.1"]
    command = [
        sys.executable,
        "-c",
        "import sys; from care_sim.cli import main; main(sys.argv[1:])",
        *sweep,
        *options,
    ]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=listen_to_interrupts,
    )
    journal = tmp_path / JOURNAL
    deadline = time.monotonic() + 40
    while (
        not (journal.exists() and journal.read_text().count("\n") >= 2)
        and time.monotonic() < deadline
    ):
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)
    _, complaint = process.communicate(timeout=40)
    assert process.returncode == 130, complaint
    assert complaint.strip().splitlines()[-1].startswith("care-sim: interrupted")
    assert "Traceback" not in complaint
    with Journal(journal) as kept:
        assert len(kept) >= 2
