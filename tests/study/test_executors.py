"""Episodes on a dask cluster: the same rows as here, and one line when there is none."""

import builtins

import pytest

from care_sim.errors import InvalidInput, MissingExtra
from care_sim.study.config import EpisodeConfig
from care_sim.study.episode import run_episode
from care_sim.study.executors import cluster
from care_sim.study.journal import Journal
from care_sim.study.runner import run_all

SHORT = (("duration_s", 0.5),)
CONFIGS = [EpisodeConfig("dartout", policy, scenario_parameters=SHORT) for policy in ("care", "history")]


@pytest.mark.slow
def test_a_dask_cluster_plays_the_same_episodes(tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local,
        Journal(tmp_path / "journal.jsonl") as journal,
    ):
        failures = run_all(CONFIGS, journal, 2, cluster(local.scheduler_address))
        assert failures == []
        for config in CONFIGS:
            assert journal[config.digest()]["episode_hash"] == run_episode(config)["episode_hash"]


def test_nobody_at_the_address_is_one_line():
    pytest.importorskip("dask.distributed")
    with pytest.raises(InvalidInput, match="no dask scheduler answers at nonsense"):
        cluster("nonsense")


def test_without_dask_the_extra_is_named(monkeypatch):
    real = builtins.__import__

    def without_dask(name, *rest):
        if name.startswith("dask"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without_dask)
    with pytest.raises(MissingExtra, match=r"care-sim\[cluster\]"):
        cluster("tcp://localhost:8786")
