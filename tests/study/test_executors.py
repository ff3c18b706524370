"""Episodes on a dask cluster of real processes: the same rows as here; deaths cost a retry, and are
one line.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.episode_play import run_episode
from care_sim.study.executors import cluster
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.runner import RunListener, run_all

MEASURED = {"wall_s", "peak_rss_mb"}
SHORT = (("duration_s", 0.5),)
LONG = (("duration_s", 3.0),)
CONFIGS = [
    EpisodeConfig("dartout", policy, scenario_parameters=SHORT) for policy in ("care", "history")
]

THIRD_PARTY = """
import os
from care_sim.policies.paper.tracks import History

class Dies(History):
    def demand(self, belief):
        os._exit(3)
"""


class Watching(RunListener):
    """Notes how many workers played."""

    def __init__(self):
        self.workers = []

    def playing(self, workers):
        self.workers.append(workers)


class Cluster:
    """A scheduler and its workers, each a process of its own on a free port."""

    def __init__(self, folder):
        self.processes = []
        self._file = folder / "scheduler.json"
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show", "--no-dashboard"
        )

    def wait(self):
        # The file is there before anything is written into it.
        until(lambda: self._file.exists() and self._file.read_text().endswith("}"))
        self.address = json.loads(self._file.read_text())["address"]

    def worker(self, *options, **environment):
        usual = ("--nthreads", "1", "--no-nanny")
        return self._start(
            "worker", *(options or usual), "--no-dashboard", "--death-timeout", "60", **environment
        )

    def _start(self, role, *options, **environment):
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.dask_{role}",
            "--scheduler-file",
            str(self._file),
            *options,
        ]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(
            command, env=os.environ | environment, start_new_session=True, **quiet
        )
        self.processes.append(process)
        return process

    def stop(self):
        for process in reversed(self.processes):
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@contextmanager
def watched(address):
    """A client that only looks on."""
    from dask.distributed import Client

    with Client(address, timeout="30s") as client:
        yield client


@pytest.fixture
def dask_cluster(request, tmp_path, monkeypatch):
    """A cluster that plays a task of a dead worker once more, or as often as the parameter says."""
    pytest.importorskip("dask.distributed")
    retries = getattr(request, "param", 1)
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", str(retries))
    started = Cluster(tmp_path)
    try:
        started.wait()
        yield started
    finally:
        started.stop()


@contextmanager
def running(configs, journal, address, listener=None):
    """A run in the background; yields what it returns or raises, once it has ended."""
    ending = {}

    def run():
        try:
            ending["failures"] = run_all(configs, journal, 1, cluster(address), listener)
        except Exception as error:
            ending["error"] = error

    thread = threading.Thread(target=run)
    thread.start()
    yield ending
    thread.join(60)
    assert not thread.is_alive()


def until(condition, seconds=40):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def steady(row):
    return {name: value for name, value in row.items() if name not in MEASURED}


@pytest.mark.slow
def test_a_killed_worker_costs_a_retry_and_every_row_is_the_one_played_here(dask_cluster, tmp_path):
    # The policy is played one by one, so that there are as many batches as episodes.
    policies = ["history-oracle"]
    configs = grid(["dartout"], policies, [0.1], range(30), scenario_parameters=LONG)
    doomed, _ = dask_cluster.worker(), dask_cluster.worker()
    listener, path = Watching(), tmp_path / "journal.jsonl"
    with watched(dask_cluster.address) as client, Journal(path) as journal:
        client.wait_for_workers(2, timeout=40)
        (address,) = (where for where, pid in client.run(os.getpid).items() if pid == doomed.pid)
        with running(configs, journal, dask_cluster.address, listener) as ending:
            until(lambda: len(journal) >= 2)
            doomed.send_signal(signal.SIGSTOP)
            time.sleep(0.3)
            until(lambda: client.processing()[address])
            doomed.kill()
        assert ending == {"failures": []}
        assert len(path.read_text().splitlines()) == len(configs)
        assert [steady(journal[config.digest()]) for config in configs] == [
            steady(run_episode(c)) for c in configs
        ]
    assert set(listener.workers) == {1, 2}


@pytest.mark.slow
def test_a_lost_scheduler_is_one_line_and_keeps_what_was_played(dask_cluster, tmp_path):
    dask_cluster.worker()
    journal = tmp_path / "out" / JOURNAL
    grid_of_200 = ["--scenarios", "dartout", "--policies", "history", "--seeds", "200"]
    options = ["--out", str(journal.parent), "--cluster", dask_cluster.address]
    command = [
        sys.executable,
        "-c",
        "from care_sim.cli import main; main()",
        "sweep",
        *grid_of_200,
        *options,
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as sweep:
        until(lambda: journal.exists() and journal.read_text().count("\n") >= 2)
        dask_cluster.scheduler.kill()
        _, complaint = sweep.communicate(timeout=40)
    gone = (
        f"care-sim: the dask scheduler at {dask_cluster.address} is gone; "
        "what is finished is kept, "
    )
    assert complaint.splitlines()[-1] == f"{gone}the same command goes on from there"
    usual = ("episodes ", "Results go to ", "the first take longer ")
    assert [line for line in complaint.splitlines()[:-1] if not line.startswith(usual)] == []
    assert sweep.returncode == 2
    with Journal(journal) as kept:
        assert 2 <= len(kept) < 200


def installed(site):
    """A package, perhaps missing on the workers, with a policy that kills its process."""
    info = site / "deadly-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "deadly.py").write_text(THIRD_PARTY)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: deadly\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[care_sim.policies]\ndies = deadly:Dies\n")


# Every death costs the start of a worker, three seconds; that a task is retried is tested above.
@pytest.mark.slow
@pytest.mark.parametrize("dask_cluster", [0], indirect=True)
def test_a_policy_that_the_workers_lack_fails_and_one_that_kills_them_does_too(
    dask_cluster, tmp_path, monkeypatch
):
    site = tmp_path / "site"
    installed(site)
    monkeypatch.syspath_prepend(site)
    configs = grid(["dartout"], ["history", "dies", "care"], [0.1], [0], scenario_parameters=SHORT)
    lacking = dask_cluster.worker()
    with Journal(tmp_path / "lacking.jsonl") as journal:
        (failure,) = run_all(configs, journal, 1, cluster(dask_cluster.address))
        assert str(failure).startswith(
            "dartout dies 0.1 seed 0 scenario.duration_s=0.5: unknown policy 'dies'; known: "
        )
        assert len(journal) == 2
    lacking.kill()
    dask_cluster.worker("--nthreads", "2", "--nanny", PYTHONPATH=str(site))
    with Journal(tmp_path / "deadly.jsonl") as journal:
        (failure,) = run_all(configs, journal, 1, cluster(dask_cluster.address))
        assert (failure.config.policy, failure.reason) == ("dies", "the worker process died")
        assert len(journal) == 2


def break_down(_batch):
    raise RuntimeError("y" * 1000)


def test_an_error_of_a_cluster_names_the_worker(tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    with (
        distributed.LocalCluster(1, threads_per_worker=1, processes=False, protocol="tcp") as here,
        Journal(tmp_path / JOURNAL) as journal,
    ):
        address = here.scheduler_address
        (failure,) = run_all(CONFIGS[:1], journal, 1, cluster(address), play_batch=break_down)
    said = f"a worker could not play it: RuntimeError: {'y' * 300}... (test_executors.py, line "
    assert failure.reason.startswith(said)


def test_nobody_at_the_address_is_one_line():
    pytest.importorskip("dask.distributed")
    with pytest.raises(InvalidInput, match="no dask scheduler answers at nonsense"):
        cluster("nonsense")
