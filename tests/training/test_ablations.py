"""Inputs that a learner is trained without never reach it, nor the weights that are kept."""

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.policies.learned.grid_features import CHANNELS
from care_sim.policies.learned.ppo import ScoreMap
from care_sim.policies.learned.weights import Card, load_weights, save_weights
from care_sim.training.config import PpoConfig
from care_sim.training.networks import mixing


def test_without_tracks_no_picture_tells_of_a_forecast():
    shown = np.arange(1.0, 7.0)
    seen = dict(zip(CHANNELS, mixing(["tracks"]) @ shown, strict=True))
    told = dict(zip(CHANNELS, shown, strict=True))
    assert seen == {
        "forecast": 0, "residual": told["residual"] + told["explained"], "explained": 0,
        "nearness": told["nearness"], "fired": told["fired"], "undetected": 0,
    }  # fmt: skip
    assert not (mixing(["pictures"]) @ shown).any()
    for without in ((), ("place",), ("faults",)):
        assert np.array_equal(mixing(without), np.eye(6))


@pytest.fixture
def learned(tmp_path):
    """A learner that learned a little without something, and the weights that it keeps."""
    pytest.importorskip("stable_baselines3")
    from care_sim.training.environments import side_by_side
    from care_sim.training.run import make_learner

    def learn(*without):
        config = PpoConfig(environments=2, rollout=32, batch=32, hidden=8, without=without)
        envs = side_by_side(config)
        model = make_learner(config, envs).learn(64)
        envs.close()
        save_weights(tmp_path / "w.npz", model.policy.arrays(), Card("ppo", AngularGrid()))
        return model, ScoreMap(load_weights(tmp_path / "w.npz"), config.wrapping)

    return learn


def observation(rng):
    return {
        "grid": rng.random(6 * 8 * 64, np.float32),
        "ego": rng.uniform(-1, 1, 4).astype(np.float32),
    }


@pytest.mark.parametrize("without", ["pictures", "place", "tracks"])
def test_the_kept_weights_act_as_the_learner_does(learned, without):
    model, numpy = learned(without)
    rng = np.random.default_rng(0)
    seen = observation(rng)
    expected, _ = model.predict(seen, deterministic=True)
    np.testing.assert_allclose(numpy(seen), expected, atol=2e-6)
    assert np.ptp(expected) > 1e-4 or without == "pictures"

    other = observation(rng)
    changed = seen | {"grid": seen["grid"].reshape(6, 8, 64).copy()}
    if without == "pictures":
        changed["grid"] = other["grid"].reshape(6, 8, 64)
    elif without == "tracks":
        # Other forecasts, and all boxes explained instead of none.
        changed["grid"][[0, 5]] = other["grid"].reshape(6, 8, 64)[[0, 5]]
        changed["grid"][[1, 2]] = changed["grid"][[2, 1]]
    else:
        # Moved round the car by whole sectors, the scores move with it.
        changed["grid"] = np.roll(changed["grid"], 2 * 5, axis=2)
    changed["grid"] = changed["grid"].ravel()
    moved = 5 if without == "place" else 0
    np.testing.assert_allclose(numpy(changed), np.roll(numpy(seen), moved, axis=1), atol=2e-6)
    anything = learned()[1]
    assert np.abs(anything(changed) - np.roll(anything(seen), moved, axis=1)).max() > 1e-4
