"""Wrappers of vector environments: every world is the single environment behind the single ones."""

import copy
from functools import partial
from itertools import product

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import care_sim  # noqa: F401
from care_sim.base.errors import InvalidInput
from care_sim.wrappers import (
    GridObservation,
    SectorReserve,
    SectorScores,
    VectorGridObservation,
    VectorSectorReserve,
    VectorSectorScores,
)
from tests.helpers.vectors import difference

WORLDS = 3
SEEDS = [3, 1, 1000]
PAIRS = {
    "reserve inside": (
        lambda env: GridObservation(SectorReserve(env)),
        lambda env: VectorGridObservation(VectorSectorReserve(env)),
    ),
    "reserve outside": (
        lambda env: SectorReserve(GridObservation(env)),
        lambda env: VectorSectorReserve(VectorGridObservation(env)),
    ),
    "scores": (
        lambda env: GridObservation(SectorScores(env, 16, 2), 32, 4),
        lambda env: VectorGridObservation(VectorSectorScores(env, 16, 2), 32, 4),
    ),
    "actions alone": (SectorReserve, VectorSectorReserve),
    "pictures alone": (
        partial(GridObservation, pictures=True),
        partial(VectorGridObservation, pictures=True),
    ),
}
CONDITIONS = {
    "dense": ("CARE-Dense-v0", {"false_negative_rate": 0.2, "duration_s": 1.5}),
    "order": ("CARE-Dense-v0", {"cell_order": "core-spread", "duration_s": 1.2}),
    # Without the floor infos are lists, which may differ in length.
    "budgets": ("CARE-Dense-v0", {"duration_s": 1.2, "floor": False}),
    # Where the window stands depends on how many cells are demanded.
    "window": (
        "CARE-Dense-v0",
        {"duration_s": 1.2, "floor": False, "firing": "azimuth-window:60"},
    ),
    "drive": ("CARE-Drive-v0", {"duration_s": 1.0, "reserve_fraction": 0.0}),
}
BUDGETS = {"budgets": [0.02, 0.3, 0.1], "window": [0.1, 0.5, 0.2]}
"""Each world has its own in these conditions; in others all have 3%."""


def given(space, steps):
    """Actions of many sorts: few sectors, ties, none at all."""
    rng = np.random.default_rng(0)
    for n in range(steps):
        actions = rng.uniform(-1, 1, space.shape).astype(np.float32)
        yield (actions, np.round(actions, 1), -np.abs(actions), actions**3)[n % 4]


def played(envs, steps=40):
    """All that vector environments answer."""
    told = [copy.deepcopy(envs.reset(seed=list(SEEDS)))]
    for actions in given(envs.action_space, steps):
        answer = envs.step(actions=actions)
        told.append(copy.deepcopy(answer))
        over = answer[2] | answer[3]
        if envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED and over.any():
            told.append(copy.deepcopy(envs.reset(options={"reset_mask": over.copy()})))
    envs.close()
    return dict(enumerate(dict(enumerate(each)) for each in told))


def singles(condition, wrap, mode):
    name, arguments = CONDITIONS[condition]

    def make(budget):
        return wrap(gymnasium.make(name, disable_env_checker=True, budget=budget, **arguments))

    budgets = BUDGETS.get(condition, [0.03] * WORLDS)
    return SyncVectorEnv([partial(make, budget) for budget in budgets], autoreset_mode=mode)


def vector(condition, mode, **further):
    name, arguments = CONDITIONS[condition]
    return gymnasium.make_vec(
        name,
        WORLDS,
        "vector_entry_point",
        autoreset_mode=mode,
        budget=BUDGETS.get(condition, 0.03),
        **arguments,
        **further,
    )


@pytest.mark.parametrize(
    ("condition", "pair", "mode"),
    [
        *product(["dense"], PAIRS, ["SameStep"]),
        *product(["dense"], ["reserve inside"], ["NextStep", "Disabled"]),
        *product(["order", "budgets"], ["reserve inside", "scores"], ["SameStep"]),
        ("drive", "reserve inside", "SameStep"),
        ("window", "scores", "SameStep"),
    ],
)
def test_a_world_is_the_single_environment_to_the_last_bit(condition, pair, mode):
    wrap, wrap_vector = PAIRS[pair]
    expected = played(singles(condition, wrap, AutoresetMode(mode)))
    for further in ({}, {"copy": False, "threads": 2}):
        found = played(wrap_vector(vector(condition, mode, **further)))
        assert difference(found, expected) is None


def test_they_stand_over_gymnasiums_own_vectors_too():
    wrap, wrap_vector = PAIRS["reserve inside"]
    same_step = AutoresetMode.SAME_STEP
    plain = singles("dense", lambda env: env, same_step)
    expected = played(singles("dense", wrap, same_step))
    assert difference(played(wrap_vector(plain)), expected) is None


def as_it_is(env):
    return env


class Hidden(gymnasium.vector.VectorObservationWrapper):
    """Hides all tracks of the first world from whatever stands around it."""

    def observations(self, observations):
        tracks = observations["tracks"].copy()
        tracks[0, :, 0] = -1
        return observations | {"tracks": tracks}


def test_a_track_that_a_wrapper_in_between_hides_is_in_no_picture_and_has_no_hull():
    plain, hidden, between = (
        VectorGridObservation(outer(VectorSectorReserve(inner(vector("dense", "NextStep")))))
        for inner, outer in ((as_it_is, as_it_is), (Hidden, as_it_is), (as_it_is, Hidden))
    )
    fired = []
    for envs in (plain, hidden, between):
        envs.reset(seed=list(SEEDS))
        nothing = np.zeros(envs.action_space.shape, np.float32)
        for _ in range(8):
            observation, *_, infos = envs.step(nothing)
        forecasts = observation["grid"].reshape(WORLDS, 6, -1)[:, 0].any(axis=1).tolist()
        assert forecasts == [envs is plain, True, True]
        fired.append(infos["fired"])
        envs.close()
    same = [(fired[0] == cells).all(axis=1).tolist() for cells in fired]
    assert same == [[True] * 3, [False, True, True], [True] * 3]


WRAPPERS = [VectorSectorReserve, VectorSectorScores, VectorGridObservation]


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_what_does_not_fit_is_refused_in_one_line(wrapper):
    envs = vector("dense", "SameStep")
    with pytest.raises(InvalidInput, match="azimuths must divide the 512 of the grid, got 30"):
        wrapper(envs, 30, 4)
    cartpoles = gymnasium.make_vec("CartPole-v1", 2, "sync")
    for other in (cartpoles, gymnasium.make("CARE-Dense-v0"), None):
        with pytest.raises(InvalidInput, match="need a vector of its environments"):
            wrapper(other)
    makers = [
        lambda margin=margin: gymnasium.make("CARE-Dense-v0", azimuth_margin=margin)
        for margin in (2, 1)
    ]
    with pytest.raises(InvalidInput, match="may differ in the budget of their rigs alone"):
        wrapper(SyncVectorEnv(makers))
    envs.close()
