"""Logs without labels in the protocol and in the environment."""

import pytest

from tests.helpers.commands import run
from tests.helpers.sweeps_log import write_log


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive")


def test_the_protocol_counts_who_detects_a_new_cluster_first(capsys, folder, tmp_path):
    played = ("--policies", "history", "care", "rows", "full", "--budgets", "0.1")
    few = ("--floor-seeds", "1", "--workers", "1", "--detector", "cluster")
    options = (*played, *few, "--out", tmp_path / "out")
    code, printed, _ = run(
        capsys, "protocol", "--source", f"sweeps:{folder}", "--verbose", *options
    )
    assert code == 0
    told = " ".join(printed.split())
    assert "events detected earlier, later or at the same keyframe as history" in told
    # Without a camera CARE fires as history does.
    assert "10% care 0.0 0.0 1.0" in told
    assert (tmp_path / "out" / "plays.parquet").exists()
