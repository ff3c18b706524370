"""A folder of one's own, and a benchmark that is small."""

import pytest

from care_sim.study.benchmark import budgets, result
from care_sim.study.benchmark.budgets import REFERENCE_ENTRIES
from care_sim.study.benchmark.result import publish_references
from tests.helpers.made_budgets import HALF_WAY, made_budgets


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def one_street(monkeypatch, tmp_path):
    """One street, with one published entry; a trial is the whole."""
    for name in ("QUICK_STREETS", "STREETS_PLAYED"):
        monkeypatch.setattr(budgets, name, 1)
    monkeypatch.setattr(result, "_REFERENCES", tmp_path / "published")
    publish_references([made_budgets(REFERENCE_ENTRIES[0], HALF_WAY, streets=1)])
