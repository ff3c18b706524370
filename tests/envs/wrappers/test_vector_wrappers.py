"""Wrappers of vector environments: every world is the single environment behind the single ones."""

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
"""Of each world its own, in these conditions; else all have 3%."""


def given(space, steps):
    """Actions of many sorts: few sectors, ties, none at all."""
    rng = np.random.default_rng(0)
    for n in range(steps):
        actions = rng.uniform(-1, 1, space.shape).astype(np.float32)
        yield (actions, np.round(actions, 1), -np.abs(actions), actions**3)[n % 4]


def copied(told):
    """All arrays of an answer, with their bytes, whatever becomes of them later."""
    if isinstance(told, dict):
        return {name: copied(value) for name, value in told.items()}
    if isinstance(told, tuple | list) or (isinstance(told, np.ndarray) and told.dtype == object):
        return [copied(value) for value in told]
    if isinstance(told, np.ndarray):
        return str(told.dtype), told.shape, told.tobytes()
    return told


def played(envs, steps=40):
    """All that vector environments answer."""
    told = [copied(envs.reset(seed=list(SEEDS)))]
    for actions in given(envs.action_space, steps):
        answer = envs.step(actions)
        told.append(copied(answer))
        over = answer[2] | answer[3]
        if envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED and over.any():
            told.append(copied(envs.reset(options={"reset_mask": over.copy()})))
    envs.close()
    return told


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
        *product(["order", "budgets", "drive"], ["reserve inside", "scores"], ["SameStep"]),
        ("window", "scores", "SameStep"),
    ],
)
def test_a_world_is_the_single_environment_to_the_last_bit(condition, pair, mode):
    wrap, wrap_vector = PAIRS[pair]
    expected = played(singles(condition, wrap, AutoresetMode(mode)))
    assert played(wrap_vector(vector(condition, mode))) == expected
    assert played(wrap_vector(vector(condition, mode, copy=False, threads=2))) == expected


def test_they_stand_over_gymnasiums_own_vectors_too():
    wrap, wrap_vector = PAIRS["reserve inside"]
    same_step = AutoresetMode.SAME_STEP
    plain = singles("dense", lambda env: env, same_step)
    assert played(wrap_vector(plain)) == played(singles("dense", wrap, same_step))


@pytest.mark.parametrize("pair", PAIRS)
def test_what_they_take_and_give_is_in_their_spaces(pair):
    envs = PAIRS[pair][1](vector("dense", "SameStep"))
    single = PAIRS[pair][0](gymnasium.make("CARE-Dense-v0", budget=0.03))
    assert envs.single_observation_space == single.observation_space
    assert envs.single_action_space == single.action_space
    observation, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observation)
    finals = 0
    for _ in range(20):
        observation, *_, infos = envs.step(envs.action_space.sample())
        assert envs.observation_space.contains(observation)
        for last in infos.get("final_obs", []):
            finals += last is not None
            assert last is None or envs.single_observation_space.contains(last)
    assert finals
    envs.close()
    single.close()


def test_what_stands_side_by_side_is_read_once():
    inside = VectorSectorReserve(vector("dense", "NextStep"))
    envs = VectorGridObservation(inside)
    envs.reset(seed=0)
    envs.step(np.zeros(envs.action_space.shape, np.float32))
    assert envs.reading.beliefs is inside.reading.beliefs
    envs.close()
    with gymnasium.make("CARE-Dense-v0", budget=0.03) as env:
        single = SectorReserve(GridObservation(env))
        single.reset(seed=0)
        assert single.reading.beliefs is single.env.reading.beliefs


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


def test_pictures_of_pictures_are_refused():
    pictures = VectorGridObservation(vector("dense", "SameStep"))
    with pytest.raises(InvalidInput, match="VectorGridObservation needs the observation"):
        VectorGridObservation(pictures)
    flat = gymnasium.wrappers.vector.FlattenObservation(vector("dense", "NextStep"))
    with pytest.raises(InvalidInput, match="put it inside the wrapper that changes"):
        VectorSectorReserve(flat)
    pictures.close()
    flat.close()


@pytest.mark.parametrize("wrapper", WRAPPERS[:2])
def test_wrong_actions_are_refused(wrapper):
    envs = wrapper(vector("dense", "SameStep"))
    if wrapper is VectorSectorReserve:
        with pytest.raises(gymnasium.error.ResetNeeded):
            envs.step(envs.action_space.sample())
    envs.reset(seed=0)
    for actions in (np.zeros((4, 32)), np.full((WORLDS, 4, 32), np.nan), np.zeros((2, 4, 32))):
        with pytest.raises(InvalidInput, match="action must"):
            envs.step(actions)
    envs.close()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda seen: seen | {"ranges": seen["ranges"][:, :-1]}, "ranges of an observation"),
        (lambda seen: seen | {"ego": seen["ego"] * np.nan}, "ego of an observation must hold"),
        (lambda seen: seen | {"budget": seen["budget"] + 1}, "budget lie in"),
        (lambda seen: seen | {"ranges": -1 - seen["ranges"]}, "must be numbers of 0 or more"),
        (lambda seen: seen | {"detections": np.full((WORLDS, 1, 9), 3.0)}, "of cameras 0 to"),
        (lambda seen: seen | {"tracks": np.full((WORLDS, 1, 13), 9.0)}, "tracks of an observ"),
        (lambda seen: {"ego": seen["ego"]}, "an observation of CARE-Sim"),
    ],
)
def test_an_observation_that_no_sensor_gives_is_refused(spoil, message):
    envs = vector("dense", "NextStep")

    class Spoiled(gymnasium.vector.VectorObservationWrapper):
        def observations(self, observations):
            return spoil(observations)

    # Pictures read all of it, and sectors all but how far the last scan saw.
    wrappers = [VectorGridObservation, VectorSectorReserve]
    for wrapper in wrappers[:1] if "0 or more" in message else wrappers:
        with pytest.raises(InvalidInput, match=message):
            wrapper(Spoiled(envs)).reset(seed=0)
    envs.close()
