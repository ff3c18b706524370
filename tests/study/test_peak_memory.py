"""The peak memory of a process, as rows tell it."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from care_sim.study.episode_play import peak_rss_mb


def test_what_the_parent_holds_is_not_counted():
    held = np.ones(60_000_000)
    assert peak_rss_mb() > held.nbytes / 1e6
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(peak_rss_mb).result() < peak_rss_mb() - held.nbytes / 2e6


def test_a_system_that_does_not_tell_the_peak_is_asked_otherwise(monkeypatch):
    monkeypatch.setattr(Path, "read_text", lambda _path: "VmRSS:\t1 kB\n")
    assert 50 < peak_rss_mb() < 100_000
