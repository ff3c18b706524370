"""A policy from outside: twenty lines, found by its entry point, through the same door as ours."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.errors import InvalidInput

MODULE = '''
import numpy as np
import care_sim


class Horizon(care_sim.Policy):
    """Beam reduction: the rows nearest to the horizon, every second column."""

    name = "horizon"

    def __init__(self, rig, rows=4):
        super().__init__(rig)
        self.rows = rows

    def demand(self, belief):
        grid = self.rig.grid
        row = np.argsort(np.abs(grid.directions[:: grid.columns, 2]), kind="stable")[: self.rows]
        cells = row[:, None] * grid.columns + np.arange(0, grid.columns, 2)
        return care_sim.Demand(layers=[[cells.ravel()]])
'''


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution on the path, as pip would leave it."""
    (tmp_path / "horizon_policy.py").write_text(MODULE)
    info = tmp_path / "horizon_policy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: horizon-policy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[care_sim.policies]\nhorizon = horizon_policy:Horizon\n")
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.fixture
def env():
    made = gymnasium.make("CARE-Dartout-v0", budget=0.1)
    yield made
    made.close()


def test_an_installed_policy_is_listed_made_and_driven(installed, env):
    assert "horizon" in care_sim.policy_names()
    policy = care_sim.make_policy("horizon", env, rows=3)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        action = policy(observation)
        observation, *_, info = env.step(action)
        assert np.count_nonzero(action) == 3 * 256
        assert set(np.flatnonzero(action).tolist()) <= set(info["fired"].tolist())
        assert len(info["fired"]) == 1638


def test_its_parameters_are_checked_like_ours(installed, env):
    with pytest.raises(InvalidInput, match="beams"):
        care_sim.make_policy("horizon", env, beams=3)


def test_without_the_distribution_it_is_unknown(env):
    with pytest.raises(InvalidInput, match="unknown policy 'horizon'"):
        care_sim.make_policy("horizon", env)


class Greedy(care_sim.Policy):
    """Asks for far more than it may fire."""

    name = "greedy"

    def demand(self, belief):
        everything = np.arange(self.rig.grid.size)
        return care_sim.Demand([everything, everything[::-1]], [[everything]])


class Lost(care_sim.Policy):
    """Asks for cells that no grid has."""

    name = "lost"

    def __init__(self, rig, cell):
        super().__init__(rig)
        self.cell = cell

    def demand(self, belief):
        return care_sim.Demand([np.array([5, self.cell])])


def test_no_demand_can_overspend(env):
    observation, _ = env.reset(seed=0)
    action = Greedy(env.unwrapped.rig)(observation)
    *_, info = env.step(action)
    assert np.count_nonzero(action) == len(info["fired"]) == 1638


@pytest.mark.parametrize("cell", [-1, 16384])
def test_cells_off_the_grid_are_refused_with_the_policys_name(env, cell):
    observation, _ = env.reset(seed=0)
    with pytest.raises(InvalidInput, match=r"policy lost: cells must lie in 0\.\.16383"):
        Lost(env.unwrapped.rig, cell)(observation)
