"""Cells that are fired several times, in both loops."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.firing.actions import scores_of
from care_sim.envs.scenes import FilmEnv
from tests.helpers.lidars import CORNERS
from tests.helpers.short_streets import few_and_short

LOOPS = ("CARE-Dense-v0", "CARE-Street-v0")
FAINT = {"lidar_stated_range_m": 15.0, "visibility_m": 200.0}
CELLS = np.arange(512 * 6, 512 * 14, 3)
"""Around the horizon, where bodies stand."""


@pytest.fixture(scope="module", params=LOOPS)
def loop(request, short_streets):
    return request.param


def seen(loop, shots, firing="energy:4", **settings):
    """Ranges (E, A) and info after `CELLS` were fired so many times."""
    budget = shots * len(CELLS) / (32 * 512)
    with gymnasium.make(loop, budget=budget, floor=False, firing=firing, **settings) as env:
        env.reset(seed=3)
        observation, *_, info = env.step(scores_of(CELLS, (32, 512)))
        return observation["ranges"].ravel()[CELLS], info


def test_more_shots_return_more_and_what_returned_before_stays(loop):
    once, some, most = (seen(loop, shots, **FAINT)[0] for shots in (1, 2, 4))
    for few, many in ((once, some), (some, most)):
        returned = few < 50
        assert np.array_equal(few[returned], many[returned])
        assert (many < 50).sum() > returned.sum() > 0


def test_one_shot_returns_what_a_free_cell_does(loop):
    free, told = seen(loop, 1, "cells", **FAINT)
    once, info = seen(loop, 1, **FAINT)
    assert np.array_equal(free, once)
    assert told["intensities"] == info["intensities"]


def test_without_strength_more_shots_return_the_same(loop):
    assert np.array_equal(seen(loop, 1)[0], seen(loop, 4)[0])


def test_every_shot_stands_in_info_and_tells_the_same(loop):
    ranges, info = seen(loop, 4, **FAINT)
    assert info["fired"] == np.repeat(CELLS, 4).tolist()
    told = np.array(info["intensities"]).reshape(-1, 4)
    assert (told == told[:, :1]).all()
    assert np.array_equal(told[:, 0] > 0, ranges < 50)


@pytest.mark.parametrize("policy", ["care-units", "fan"])
def test_every_shot_is_paid(loop, policy):
    with gymnasium.make(loop, budget=0.03, firing="energy", **FAINT) as env:
        chosen = care_sim.make_policy(policy, env)
        observation, _ = env.reset(seed=0)
        for _ in range(3):
            observation, *_, info = env.step(chosen(observation))
            assert len(info["fired"]) == 492


@pytest.mark.parametrize("policy", ["care-units", "fan"])
def test_several_lidars_share_the_shots_of_a_street(policy):
    with (
        few_and_short(3),
        gymnasium.make(
            "CARE-Street-v0", budget=0.2, firing="energy", sensor=CORNERS, **FAINT
        ) as env,
    ):
        chosen = care_sim.make_policy(policy, env)
        observation, _ = env.reset(seed=0)
        ended, fired = False, []
        while not ended:
            observation, _, terminated, truncated, info = env.step(chosen(observation))
            ended = terminated or truncated
            assert len(info["fired"]) <= 205
            assert np.bincount(info["fired"]).max() <= 4
            fired.extend(info["fired"])
    assert {*CORNERS.grid.lidars_of(np.array(fired)).tolist()} == {0, 1, 2}


def test_pictures_and_vectors_take_repeated_cells(loop):
    with gymnasium.make(loop, firing="energy", render_mode="rgb_array", **FAINT) as env:
        policy = care_sim.make_policy("care-units", env)
        observation, _ = env.reset(seed=0)
        env.step(policy(observation))
        assert env.render().ndim == 3
    envs = gymnasium.make_vec(
        f"care_sim:{loop}", num_envs=2, vectorization_mode="sync", firing="energy", **FAINT
    )
    envs.reset(seed=0)
    mask = np.zeros((2, 32, 512), np.float32)
    mask[:, 9, 200:300] = 1
    *_, info = envs.step(mask)
    assert info["fired"].shape == (2, 1638)
    assert (np.bincount(info["fired"][0])[9 * 512 + 200 : 9 * 512 + 300] == 4).all()
    envs.close()


@pytest.mark.parametrize("kept", ["last", "both"])
def test_a_street_that_one_film_cannot_tell_is_refused_in_one_line(kept):
    settings = {"lidar_divergence_mrad": 3.0, "lidar_returns": kept, **FAINT}
    with pytest.raises(InvalidInput, match="lidar_returns must be strongest on a street"):
        gymnasium.make("CARE-Street-v0", firing="energy", **settings)


def test_a_film_of_fewer_shots_is_refused_in_one_line(short_streets):
    with gymnasium.make("CARE-Street-v0", firing="energy:2", **FAINT) as env:
        env.reset(seed=0)
        film = env.unwrapped.loop.film
    with FilmEnv(film, firing="cells", **FAINT) as env:
        assert env.rig.hardware.most_shots == 1
    with pytest.raises(InvalidInput, match="holds what returns to 2 shots of a cell at most"):
        FilmEnv(film, firing="energy:3", **FAINT)
