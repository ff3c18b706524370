"""Sectors as actions and coarse pictures as observation, over the environments of both loops."""

import inspect
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
import care_sim.wrappers
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.core.belief import Belief
from care_sim.core.types import ImageDetections
from care_sim.envs.wrappers.grid_observation import GridObservation
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores
from care_sim.policies.learned.grid_features import GridFeatures

NAMES = ("CARE-Dense-v0", "CARE-Street-v0", "CARE-Replay-v0")
ORDERS = [
    lambda env: GridObservation(SectorReserve(env)),
    lambda env: SectorReserve(GridObservation(env)),
    lambda env: GridObservation(SectorScores(env)),
    lambda env: SectorScores(GridObservation(env)),
]


@pytest.fixture(params=NAMES)
def env(request, short_streets):
    given = {}
    if request.param == "CARE-Replay-v0":
        given["source"] = f"argoverse2:{request.getfixturevalue('drive')}"
    made = gymnasium.make(request.param, disable_env_checker=True, budget=0.03, **given)
    yield made
    made.close()


@pytest.mark.parametrize("wrap", ORDERS)
def test_stable_baselines3_and_gymnasium_find_nothing_to_complain_about(env, wrap):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wrapped = wrap(env)
        checker.check_env(wrapped)
        again = gymnasium.make(wrapped.spec, disable_env_checker=True)
        assert (again.observation_space, again.action_space) == (
            wrapped.observation_space,
            wrapped.action_space,
        )
        again.close()
    observation, _ = wrapped.reset(seed=1)
    for _ in range(5):
        assert wrapped.observation_space.contains(observation)
        observation, *_ = wrapped.step(wrapped.action_space.sample())


def fired(env, actions, seed=3):
    """The cells of every keyframe; an action, or what maps an observation to one."""
    observation, _ = env.reset(seed=seed)
    cells = []
    for action in actions:
        observation, *_, info = env.step(action(observation) if callable(action) else action)
        cells.append(info["fired"].tolist())
    return cells


def test_nothing_in_reserve_is_the_history_policy_cell_for_cell(env):
    history = care_sim.make_policy("history", env)
    plain = fired(env, [history] * 8)
    assert fired(SectorReserve(env), [np.zeros((4, 32), np.float32)] * 8) == plain
    assert fired(GridObservation(SectorReserve(env)), [-np.ones((4, 32), np.float32)] * 8) == plain


def test_the_reserve_goes_to_the_best_sector_and_exploitation_stays():
    env = gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=0.03)
    wrapped = SectorReserve(env)
    scores = np.zeros((4, 32), np.float32)
    scores[1, 15] = 0.9
    scores[2, 16] = 0.5
    best = wrapped.sectors.cells[32 + 15]
    second = wrapped.sectors.cells[64 + 16]
    wrapped.reset(seed=0)
    for _ in range(10):
        rig = env.unwrapped.rig
        belief = env.unwrapped.loop.belief
        hulls = care_sim.Demand(rig.hulls(belief.tracks.boxes))
        exploited = care_sim.allocate(hulls, rig.budget, rig.reserve_fraction)[
            : round(0.7 * rig.budget)
        ]
        cells = set(wrapped.step(scores)[-1]["fired"].tolist())
        assert len(cells) == rig.budget
        assert set(exploited.tolist()) <= cells
        assert set(best.tolist()) <= cells
    left = rig.budget - len(set(exploited.tolist()) | set(best.tolist()))
    unexploited = [cell for cell in second.tolist() if cell not in set(exploited.tolist())]
    assert set(unexploited[:left]) <= cells
    env.close()


@pytest.mark.parametrize("wrapper", [SectorReserve, SectorScores])
def test_the_scores_of_an_action_are_the_callers_own(wrapper):
    with wrapper(gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=0.03)) as env:
        env.reset(seed=0)
        first = env.action(np.ones((4, 32), np.float32))
        kept = first.copy()
        env.action(np.eye(4, 32, 5, np.float32))
        np.testing.assert_array_equal(first, kept)


def test_scores_of_sectors_fire_the_best_sectors():
    env = SectorScores(gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=0.03))
    scores = np.full((4, 32), -1, np.float32)
    scores[3, 31] = 0.2
    scores[0, 0] = 0.1
    (cells,) = fired(env, [scores])
    tiles = env.sectors.cells
    assert set(tiles[3 * 32 + 31].tolist()) | set(tiles[0].tolist()) <= set(cells)
    assert len(cells) == 492
    env.close()


class Hidden(gymnasium.ObservationWrapper):
    """Hides rows of a table from whatever stands around it."""

    def __init__(self, env, table, rows=slice(None)):
        super().__init__(env)
        self.table = table
        self.rows = rows

    def observation(self, observation):
        table = observation[self.table].copy()
        table[self.rows, 0] = -1
        return observation | {self.table: table}


def a_keyframe_with_a_residual(wrap):
    """Six channels of blocks at the first keyframe of a street that has an unexplained box."""
    env = wrap(gymnasium.make("CARE-Street-v0", disable_env_checker=True, budget=0.1))
    channels = env.reset(seed=0)[0]["grid"].reshape(6, 8, 64)
    env.close()
    return channels


@pytest.mark.parametrize("wrap", [GridObservation, lambda env: GridObservation(SectorReserve(env))])
def test_a_detection_that_a_wrapper_in_between_hides_vanishes_from_the_residual(wrap):
    plain, without_first, blind = (
        a_keyframe_with_a_residual(lambda env, rows=rows: wrap(Hidden(env, "detections", rows)))
        for rows in (slice(0), 0, slice(None))
    )
    env = gymnasium.make("CARE-Street-v0", disable_env_checker=True, budget=0.1)
    observation, _ = env.reset(seed=0)
    belief = Belief.from_observation(observation)
    fewer = replace(belief, detections=ImageDetections.from_rows(belief.detections.rows()[1:]))
    features = GridFeatures(env.unwrapped.rig)
    env.close()
    assert not belief.tracks.ids.size, "no forecast explains anything at the first keyframe"
    np.testing.assert_array_equal(plain.ravel(), features(belief)["grid"])
    np.testing.assert_array_equal(without_first.ravel(), features(fewer)["grid"])
    assert without_first[1].sum() < plain[1].sum()
    assert plain[1].any()
    assert not blind[1].any()


@pytest.mark.parametrize("wrap", [SectorReserve, lambda env: SectorReserve(GridObservation(env))])
def test_a_track_that_a_wrapper_in_between_hides_has_no_hull(wrap):
    env = gymnasium.make("CARE-Dense-v0", disable_env_checker=True, budget=0.03)
    nothing = [np.zeros((4, 32), np.float32)] * 8
    random = fired(env, [care_sim.make_policy("random", env)] * 8)
    assert fired(wrap(Hidden(env, "tracks")), nothing) == random
    assert fired(wrap(env), nothing) != random
    env.close()


@pytest.mark.parametrize("wrapper", [SectorReserve, SectorScores, GridObservation])
def test_what_does_not_fit_is_refused_in_one_line(wrapper):
    env = gymnasium.make("CARE-Dense-v0", disable_env_checker=True)
    with pytest.raises(InvalidInput, match="azimuths must divide the 512 of the grid, got 30"):
        wrapper(env, 30, 4)
    with pytest.raises(InvalidInput, match="need one of its environments"):
        wrapper(gymnasium.make("CartPole-v1"))
    flat = gymnasium.wrappers.FlattenObservation(env)
    if wrapper is not SectorScores:
        with pytest.raises(InvalidInput, match=r"needs the (observation|forecasts)"):
            wrapper(flat)
        # The space is as before, but what comes is something else.
        liar = gymnasium.wrappers.TransformObservation(env, lambda _: {}, env.observation_space)
        with pytest.raises(InvalidInput, match="an observation of CARE-Sim's environments"):
            wrapper(liar).reset(seed=0)
    env.close()


@pytest.mark.parametrize("name", care_sim.wrappers.__all__)
def test_their_examples_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document = inspect.cleandoc(getattr(care_sim.wrappers, name).__doc__)
    _, example = document.split("### Example\n```python\n")
    given = {"gymnasium": gymnasium, "np": np, "care_sim": care_sim, **vars(care_sim.wrappers)}
    try:
        exec(example.removesuffix("```"), given)
    except MissingExtra as error:
        pytest.skip(str(error))
    given["env"].close()
