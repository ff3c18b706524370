"""The versions that a study records."""

import sys
from importlib.metadata import packages_distributions, version

import pytest

from care_sim.study.provenance import package_versions, versions


@pytest.mark.smoke
def test_the_simulator_has_one_name_whichever_distribution_brings_it():
    (distribution,) = packages_distributions()["pybullet"]
    assert versions()["pybullet"] == version(distribution)


def test_the_fork_is_recorded_as_pybullet(tmp_path, monkeypatch):
    info = tmp_path / "pybullet_arm64-3.2.8.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: pybullet-arm64\nVersion: 3.2.8\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    assert package_versions("pybullet") == {"pybullet": "3.2.8"}
