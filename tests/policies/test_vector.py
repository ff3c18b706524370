"""A policy of many worlds asks for what as many of its kind ask for alone, to the last bit."""

from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.base.threads import Threads
from care_sim.certify.design import AS_LISTED
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.cells.stack import GridStack
from care_sim.core.defaults import CELL_ORDERS
from care_sim.core.grid import AngularGrid
from care_sim.core.types import Demand
from care_sim.envs.sensing import sensing
from care_sim.policies import BUILT_IN
from care_sim.policies.base import FixedPolicy, PrivilegedPolicy, RowPolicy
from care_sim.policies.paper.blind import Random
from care_sim.policies.paper.reserves import Care
from care_sim.policies.vector import vector_policy

WORLDS = 3
SCENES = {"dense": "CARE-Dense-v0", "drive": "CARE-Drive-v0"}


def of_kind(kind):
    """The built-in policies of a kind, without those that are loaded when they are asked for."""
    return [
        name for name, make in BUILT_IN.items() if isinstance(make, type) and issubclass(make, kind)
    ]


PRIVILEGED, BY_ROWS, FIXED = map(of_kind, (PrivilegedPolicy, RowPolicy, FixedPolicy))
# Weights are of one grid.
ANY_GRID = [name for name in BY_ROWS if "learned" not in care_sim.policies.tags_of(name)]
TILTED = AngularGrid(columns=64, rows=8, pitch=0.05, roll=-0.02)
BESIDE = AngularGrid(columns=64, rows=4, range_m=30.0)
GRIDS = {
    "level": AngularGrid(),
    "tilted": TILTED,
    "stacked": GridStack((AngularGrid(columns=64, rows=8), BESIDE), ((0, 0, 0), (-3.0, 0.4, -0.9))),
}


class Worlds(gymnasium.vector.VectorEnv):
    """The attributes that a policy reads of a vector environment whose worlds are like an
    environment.
    """

    def __init__(self, env):
        self.num_envs = WORLDS
        self.rig, self.scenario, self.min_returns = env.rig, env.scenario, env.min_returns
        self.observation_space = self.action_space = None


def recorded(env):
    """Observations of whole keyframes of as many worlds, from where something is to be seen."""
    care = care_sim.make_policy("care", env)
    plays = []
    for seed in range(WORLDS):
        observation, _ = env.reset(seed=seed)
        plays.append([])
        for keyframe in range(24):
            if keyframe > 2 and keyframe % 6 < 2:
                plays[-1].append(observation)
            observation, *_ = env.step(care(observation))
    return [stacked(together) for together in zip(*plays, strict=True)]


def stacked(observations):
    return {name: np.stack([one[name] for one in observations]) for name in observations[0]}


def world(observation, number):
    return {name: table[number] for name, table in observation.items()}


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    """An environment and what is seen in its worlds."""
    given = {"duration_s": 12.0} if request.param == "drive" else {}
    env = gymnasium.make(SCENES[request.param], budget=0.05, disable_env_checker=True, **given)
    yield sensing(env), recorded(env)
    env.close()


@pytest.mark.parametrize("name", [name for name in BUILT_IN if name not in (*PRIVILEGED, "full")])
def test_every_world_is_asked_as_if_alone(name, scene):
    env, observations = scene
    given = AS_LISTED.get(name, {})
    together = care_sim.make_policy(name, Worlds(env), **given)
    alone = [care_sim.make_policy(name, env, **given) for _ in range(WORLDS)]
    for observation in observations:
        actions = together(observation)
        for number, policy in enumerate(alone):
            assert np.array_equal(actions[number], policy(world(observation, number)))


@pytest.mark.parametrize("name", PRIVILEGED)
def test_a_privileged_policy_is_refused_in_one_line(name, environment):
    with pytest.raises(InvalidInput, match="plays a single environment") as refused:
        care_sim.make_policy(name, Worlds(sensing(environment)))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("grid", "order"), [*zip([*GRIDS] * 2, CELL_ORDERS, strict=False)])
@pytest.mark.parametrize("name", ANY_GRID)
def test_ideas_by_rows_are_the_same_on_every_grid(name, order, grid, dense):
    base, observations = dense
    grid = GRIDS[grid]
    rig = replace(base, grid=grid, cell_order=order, budget=grid.size // 12)
    shown = [
        observation
        | {
            "budget": np.full((WORLDS, 1), rig.budget / grid.size, np.float32),
            "ranges": np.zeros((WORLDS, *grid.shape), np.float32),
        }
        for observation in observations[:2]
    ]
    together = vector_policy(lambda: BUILT_IN[name](rig), WORLDS, Threads(2))
    alone = BUILT_IN[name](rig)
    for observation in shown:
        actions = together(observation)
        for number in range(WORLDS):
            assert np.array_equal(actions[number], alone(world(observation, number)))


@pytest.fixture(scope="module")
def dense():
    with gymnasium.make("CARE-Dense-v0", budget=0.1, disable_env_checker=True) as env:
        yield sensing(env).rig, recorded(env)


@pytest.mark.parametrize("name", ["care", "care-sbf", "sweep", "place", "ppo"])
def test_worlds_that_rest_are_not_read_and_remember_nothing(name, dense):
    rig, observations = dense
    make = BUILT_IN[name]
    together, alone = vector_policy(lambda: make(rig), WORLDS), [make(rig) for _ in range(WORLDS)]
    for keyframe, observation in enumerate(observations):
        live = np.array([number != keyframe % WORLDS for number in range(WORLDS)])
        if keyframe == 3:
            mask = np.array([True, False, True])
            together.reset(mask)
            for number in np.flatnonzero(mask):
                alone[number].reset()
        shown = {name: table.copy() for name, table in observation.items()}
        for table in shown.values():
            table[~live] = np.nan
        actions = together(shown, live)
        for number in np.flatnonzero(live):
            assert np.array_equal(actions[number], alone[number](world(observation, number)))


@pytest.mark.parametrize("name", [*BY_ROWS, *FIXED])
def test_a_budget_is_that_of_its_own_world(name, dense):
    rig, observations = dense
    if name == "full":
        return
    make = BUILT_IN[name]
    together, alone = vector_policy(lambda: make(rig), WORLDS), make(rig)
    budgets = np.array([[0.02], [0.07], [0.1]], np.float32)
    for observation in observations[:2]:
        observation = observation | {"budget": budgets}
        actions = together(observation)
        for number in range(WORLDS):
            assert np.array_equal(actions[number], alone(world(observation, number)))
        budgets = budgets[::-1]


class Halved(Care):
    """Somebody's policy that changes what another one asks for."""

    def demand(self, belief):
        asked = super().demand(belief)
        return Demand(asked.exploitation[::2], asked.layers)


class Growing(Random):
    """Somebody's policy that has a memory where the other has none."""

    def __init__(self, rig):
        super().__init__(rig)
        self.reset()

    def reset(self):
        self._seen = 0

    def remember(self, belief):
        self._seen += 1

    def fixed(self, budget):
        return Demand(layers=[[np.arange(self._seen)]])


@pytest.mark.parametrize("make", [Halved, Growing])
def test_what_somebody_changed_is_asked_for_in_every_world(make, dense):
    rig, observations = dense
    together, alone = vector_policy(lambda: make(rig), WORLDS), [make(rig) for _ in range(WORLDS)]
    for observation in observations:
        actions = together(observation)
        for number, policy in enumerate(alone):
            assert np.array_equal(actions[number], policy(world(observation, number)))


@pytest.mark.parametrize("cell", [-1, 16_384, 2**40])
def test_a_cell_that_the_grid_lacks_is_refused_before_compiled_code_meets_it(cell, dense):
    class Astray(Care):
        name = "astray"

        def stages(self, beliefs):
            cells = np.full(len(beliefs), cell)
            return [WorldSets(CellSets(cells, np.ones_like(cells)), np.ones_like(cells))]

    rig, observations = dense
    with pytest.raises(InvalidInput, match=r"^policy astray: cells must lie in 0\.\.16383$"):
        vector_policy(lambda: Astray(rig), WORLDS)(observations[0])


@pytest.mark.parametrize("name", ["care", "ppo", "beam-reduce", "sweep"])
def test_worlds_of_several_budgets_play_each_its_own(name):
    budgets = [0.1, 0.03, 0.1, 0.01]
    with (
        closing(gymnasium.make_vec("CARE-Dense-v0", 4, budget=budgets)) as envs,
        ExitStack() as singles,
    ):
        policy, alone = care_sim.make_policy(name, envs), []
        for budget in budgets:
            env = singles.enter_context(gymnasium.make("CARE-Dense-v0", budget=budget))
            alone.append(care_sim.make_policy(name, env))
        observation, _ = envs.reset(seed=4)
        for step in range(12):
            if step == 6:
                again = np.array([True, False, False, True])
                policy.reset(again)
                for world in np.flatnonzero(again):
                    alone[world].reset()
            live = np.array([True, step % 3 > 0, True, step % 2 > 0])
            actions = policy(observation, live)
            for world in np.flatnonzero(live):
                own = alone[world]({key: rows[world] for key, rows in observation.items()})
                assert np.array_equal(actions[world], own)
            observation, *_ = envs.step(actions)


def test_worlds_that_differ_in_what_a_policy_is_told_and_worlds_of_others_are_refused():
    makers = [partial(gymnasium.make, "CARE-Dense-v0", min_returns=least) for least in (3, 5)]
    with (
        closing(SyncVectorEnv(makers)) as envs,
        pytest.raises(InvalidInput, match="must have one min_returns"),
    ):
        care_sim.make_policy("care-spread", envs)
    cartpoles = gymnasium.make_vec("CartPole-v1", 2, "sync")
    with pytest.raises(InvalidInput, match="needs an environment of CARE-Sim with a rig"):
        care_sim.make_policy("care", cartpoles)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("ego", np.full((WORLDS, 3), np.nan, np.float32)),
        ("budget", np.full((WORLDS, 1), 1.5, np.float32)),
        ("ranges", np.zeros((WORLDS, 16, 512), np.float32)),
        ("tracks", np.full((WORLDS, 2, 13), np.inf, np.float32)),
        ("detections", np.full((WORLDS, 2, 9), 3.0, np.float32)),
    ],
)
def test_what_is_no_observation_of_its_rig_is_refused_in_one_line(key, value, dense):
    rig, observations = dense
    policy = vector_policy(lambda: Care(rig), WORLDS)
    before = policy(observations[0]).copy()
    with pytest.raises(InvalidInput, match=f"^{key}|{key}") as refused:
        policy(observations[0] | {key: value})
    assert "\n" not in str(refused.value)
    assert np.array_equal(policy(observations[0]), before)
    with pytest.raises(InvalidInput, match="live must be 3 truth values"):
        policy(observations[0], np.ones(2, np.bool_))
    with pytest.raises(InvalidInput, match="mask must be 3 truth values"):
        policy.reset(np.arange(3))
