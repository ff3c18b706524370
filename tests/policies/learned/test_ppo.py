"""The learned allocator as a policy of the benchmark: weights in, the learner's choices out,
without PyTorch.
"""

from dataclasses import asdict

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.envs.wrappers.grid_observation import GridObservation
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores
from care_sim.policies.learned.grid_features import CHANNELS
from care_sim.policies.learned.ppo import ScoreMap
from care_sim.policies.learned.weights import (
    Card,
    Weights,
    Wrapping,
    load_weights,
    save_weights,
)
from care_sim.training.validation import ValidationScore, play, rule
from tests.helpers.untrained import shapes, untrained

ACTIONS = {"SectorReserve": SectorReserve, "SectorScores": SectorScores}


@pytest.fixture
def env():
    made = gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=0.03)
    yield made
    made.close()


def score_map(wrapping, goes_round=True, **arrays):
    """A map of zeros but for the arrays."""
    zeros = {
        name: np.zeros(shape, np.float32) for name, shape in shapes(wrapping, hidden=1).items()
    }
    given = {name: np.asarray(array, np.float32) for name, array in arrays.items()}
    return ScoreMap(Weights("hand", zeros | given, None), wrapping, goes_round)


def observation(wrapping, channel, *blocks):
    grid = np.zeros((len(CHANNELS), wrapping.rows, wrapping.columns), np.float32)
    for row, column in blocks:
        grid[channel, row, column] = 1.0
    return {"grid": grid.ravel(), "ego": np.array([0.5, 0, 0, 0], np.float32)}


def test_every_sector_sees_its_blocks_and_one_more_on_each_side_over_the_seam():
    wrapping = Wrapping(azimuths=4, elevations=2, columns=8, rows=4)
    kernel = np.zeros((1, len(CHANNELS), 4, 4))
    kernel[0, 1] = 1.0
    scores = score_map(
        wrapping, **{"window.weight": kernel, "hidden.weight": [[1.0]], "score.weight": [0.1]}
    )
    lit = np.tanh(0.1)
    for blocks, expected in {
        (0, 0): [[lit, 0, 0, lit], [0, 0, 0, 0]],
        (1, 3): [[0, lit, lit, 0], [0, lit, lit, 0]],
        (3, 7): [[0, 0, 0, 0], [lit, 0, 0, lit]],
    }.items():
        np.testing.assert_allclose(scores(observation(wrapping, 1, blocks)), expected, atol=1e-6)
    assert not scores(observation(wrapping, 0, (0, 0))).any()


def test_without_a_seam_the_last_sector_is_no_neighbour_of_the_first():
    wrapping = Wrapping(azimuths=4, elevations=1, columns=4, rows=1)
    kernel = np.ones((1, len(CHANNELS), 3, 3))
    network = {"window.weight": kernel, "hidden.weight": [[1.0]], "score.weight": [0.1]}
    lit = np.tanh(0.1)
    for goes_round, expected in ((True, [lit, lit, 0, lit]), (False, [lit, lit, 0, 0])):
        scores = score_map(wrapping, goes_round, **network)
        found = scores(observation(wrapping, 1, (0, 0)))
        np.testing.assert_allclose(found, [expected], atol=1e-6)


def test_the_cars_own_motion_and_the_place_count():
    wrapping = Wrapping(azimuths=2, elevations=1, columns=2, rows=1)
    own = {
        "ego.weight": [[2, 0, 0, 0]],
        "window.bias": [-0.25],
        "hidden.weight": [[2]],
        "hidden.bias": [0.5],
    }
    scores = score_map(wrapping, **own, **{"score.weight": [0.5], "place": [[0.0, -1.0]]})
    np.testing.assert_allclose(scores(observation(wrapping, 0)), [np.tanh([1.0, 0.0])], atol=1e-6)


@pytest.mark.parametrize("action", ACTIONS)
def test_it_fires_what_its_learner_would_behind_the_wrappers(tmp_path, env, action):
    wrapping = Wrapping(action, azimuths=16, elevations=2, columns=32, rows=4)
    path = untrained(tmp_path / "w.npz", wrapping)
    policy = care_sim.make_policy("ppo", env, path=path)
    behind = GridObservation(ACTIONS[action](env, 16, 2), 32, 4)
    learned = ScoreMap(load_weights(path), wrapping)
    fired = []
    for wrapped, choose in ((env, policy), (behind, learned)):
        seen, _ = wrapped.reset(seed=4)
        cells = []
        for _ in range(30):
            seen, *_, info = wrapped.step(choose(seen))
            cells.append(info["fired"].tolist())
        fired.append(cells)
    assert fired[0] == fired[1]


@pytest.mark.parametrize("goes_round", [True, False])
def test_numpy_predicts_what_stable_baselines3_does(tmp_path, env, goes_round):
    pytest.importorskip("stable_baselines3")
    from care_sim.training.config import PpoConfig
    from care_sim.training.environments import side_by_side
    from care_sim.training.run import make_learner

    config = PpoConfig(environments=2, rollout=32, batch=32, hidden=8)
    envs = side_by_side(config)
    model = make_learner(config, envs, goes_round).learn(128)
    save_weights(tmp_path / "w.npz", model.policy.arrays(), Card("ppo", AngularGrid()))
    numpy = ScoreMap(load_weights(tmp_path / "w.npz"), config.wrapping, goes_round)
    observations = envs.reset()
    for _ in range(20):
        actions, _ = model.predict(observations, deterministic=True)
        for number, expected in enumerate(actions):
            one = {name: array[number] for name, array in observations.items()}
            np.testing.assert_allclose(numpy(one), expected, atol=2e-6)
            assert np.array_equal(
                np.argsort(-numpy(one).ravel())[:3], np.argsort(-expected.ravel())[:3]
            )
        observations, *_ = envs.step(actions)
    assert np.abs(actions).max() > 0.01
    envs.close()


@pytest.mark.parametrize(
    ("card", "message"),
    [
        ({"budget": 819}, r"budget is 819 cells \(0.04999\), needed is 492"),
        ({"grid": AngularGrid(columns=256)}, "grid is columns 256"),
        ({"kind": "learned-scorer"}, "kind is 'learned-scorer', needed is 'ppo'"),
        ({"wrapper": None}, "the card names no wrapper"),
        (
            {"wrapper": "GridObservation"},
            "wrapper 'GridObservation' is none of the form 'SectorReserve 32 x 4, Grid",
        ),
        (
            {"wrapper": "SectorReserve 16 x 4, GridObservation 64 x 8"},
            "array 'window.weight' has the shape",
        ),
        ({"wrapper": Wrapping(azimuths=16)}, "array 'window.weight' has the shape"),
        (
            {"wrapper": "SectorReserve 0 x 4, GridObservation 64 x 8"},
            "azimuths must be a whole number >= 1",
        ),
        (
            {"wrapper": "SectorReserve 32 x 4, GridObservation 48 x 8"},
            "azimuths must divide columns, got 32 and 48",
        ),
        (
            {"wrapper": asdict(Wrapping()) | {"columns": 48}},
            "azimuths must divide columns, got 32 and 48",
        ),
    ],
)
def test_weights_for_something_else_are_refused_in_one_line(tmp_path, env, card, message):
    path = untrained(tmp_path / "w.npz", **card)
    with pytest.raises(InvalidInput, match=message) as error:
        care_sim.make_policy("ppo", env, path=path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["ppo", "ppo-dartout"])
@pytest.mark.parametrize("budget", [0.03, 0.2])
def test_the_shipped_weights_fit_any_budget_and_see_the_person_early(name, budget):
    """Earlier on average than `history` by metres; nobody may be missed."""
    distances = {}
    for policy in (name, "history"):
        env = gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=budget)
        score = ValidationScore.of(play(env, rule(policy, env), dict.fromkeys(range(3), "")))
        distances[policy] = score.distance_m
        env.close()
    assert distances[name] > distances["history"] + 2


def test_it_is_no_policy_behind_wrappers_of_learners(env):
    for wrapped in (SectorReserve(env), GridObservation(env), GridObservation(SectorScores(env))):
        with pytest.raises(
            InvalidInput, match=r"policy ppo plays .*: give and step env\.unwrapped"
        ):
            care_sim.make_policy("ppo", wrapped)
    care_sim.make_policy("ppo", SectorReserve(env).unwrapped)
