from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.workers import worker_memory
from care_sim.study.episode_play import peak_rss_mb

COUNTED_LATE_MB = 1.0
"""Linux counts pages in batches a core, so that a peak may read a little less than the one
before."""


def test_what_the_parent_holds_is_not_counted():
    held = np.ones(60_000_000)
    assert peak_rss_mb() > held.nbytes / 1e6
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(peak_rss_mb).result() < peak_rss_mb() - held.nbytes / 2e6


@pytest.mark.slow
def test_a_worker_grows_by_its_episodes_alone():
    memory = worker_memory(BenchConfig(resets=20))
    assert memory["resets"] == 20
    assert 50 < memory["begun_mb"] < memory["early_mb"] < memory["peak_mb"] + COUNTED_LATE_MB < 1000


def test_a_system_that_does_not_tell_the_peak_is_asked_otherwise(monkeypatch):
    monkeypatch.setattr(Path, "read_text", lambda _path: "VmRSS:\t1 kB\n")
    assert 50 < peak_rss_mb() < 100_000
