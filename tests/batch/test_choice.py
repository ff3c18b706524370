"""What all worlds fire is what each fires alone."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.random_streams import streams
from care_sim.batch.scanning import Choice
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.grid import AngularGrid
from care_sim.core.random_floor import RandomFloor
from care_sim.core.rig import Rig
from care_sim.envs.sensing import sensing

WORLDS = 3
GRID = AngularGrid(columns=8, rows=5)
NOTHING = np.empty(0, np.int64)
# Few values, so that scores tie, and as many cells that are not demanded.
scores = st.lists(
    st.sampled_from([0.0, -1.0, 1e-40, 0.3, 0.5, 1.0, 7.0]), min_size=GRID.size, max_size=GRID.size
)
few = st.dictionaries(st.integers(0, GRID.size - 1), st.sampled_from([0.5, 1.0]), max_size=6).map(
    lambda some: [some.get(cell, 0.0) for cell in range(GRID.size)]
)
keyframes = st.lists(
    st.tuples(
        st.lists(st.one_of(few, scores), min_size=WORLDS, max_size=WORLDS),
        st.lists(st.booleans(), min_size=WORLDS, max_size=WORLDS),
    ),
    max_size=5,
)


budgets = st.lists(st.integers(1, GRID.size), min_size=WORLDS, max_size=WORLDS)


def rows(fired):
    counts, cells = fired
    return [row[:count].tolist() for count, row in zip(counts, cells, strict=True)]


@given(keyframes, budgets, st.booleans(), st.integers(0, 2))
def test_every_world_fires_as_if_alone(played, budgets, floor, floor_seed):
    rig = Rig(GRID)
    conditions = ClosedLoopConditions(floor=floor, floor_seed=floor_seed)
    choice = Choice(rig, conditions, np.array(budgets))
    floors = []
    for world in range(WORLDS):
        choice.begin(world, np.random.SeedSequence(world))
        floors.append(RandomFloor(np.random.SeedSequence(world), floor_seed, GRID.size))
    now = np.zeros(WORLDS, np.int64)
    for given_scores, live in played:
        action = np.array(given_scores, np.float32).reshape(WORLDS, *GRID.shape)
        alone = [
            rig.hardware.fire(
                action[world],
                budgets[world],
                partial(floors[world].at, now[world]) if floor else None,
                NOTHING,
            ).tolist()
            if live[world]
            else []
            for world in range(WORLDS)
        ]
        assert rows(choice.fired(action, np.array(live), now)) == alone
        now += live


@pytest.mark.parametrize("budget", [0.03, 0.1])
def test_published_episodes_fire_the_same(budget):
    """Some keyframes spend the budget, and the floor of the next one is that of its number."""
    envs = [
        sensing(gymnasium.make("CARE-Dense-v0", budget=budget, disable_env_checker=True))
        for _ in range(2)
    ]
    choice = Choice(envs[0].rig, envs[0].conditions, np.array([env.rig.budget for env in envs]))
    for world, env in enumerate(envs):
        env.reset(seed=world)
        choice.begin(world, streams((world,), 5)[3])
    live = np.ones(len(envs), np.bool_)
    rng = np.random.default_rng(0)
    for keyframe in range(6):
        shares = rng.choice([0.0, 0.05, 0.5], len(envs))
        drawn = rng.random((len(envs), *envs[0].rig.grid.shape)).astype(np.float32)
        action = np.where(rng.random(drawn.shape) < shares[:, None, None], drawn, np.float32(0))
        together = rows(choice.fired(action, live, np.full(len(envs), keyframe)))
        alone = [env.step(own)[4]["fired"].tolist() for env, own in zip(envs, action, strict=True)]
        assert together == alone
    for env in envs:
        env.close()


def test_a_new_episode_begins_with_its_first_floor():
    choice = Choice(Rig(GRID), ClosedLoopConditions(), np.array([7, 7]))
    nothing = np.zeros((2, *GRID.shape), np.float32)
    every, first = np.ones(2, np.bool_), np.zeros(2, np.int64)
    for world in range(2):
        choice.begin(world, np.random.SeedSequence(5))
    begun, other = rows(choice.fired(nothing, every, first))
    assert begun == other
    later = rows(choice.fired(nothing, every, first + 1))
    assert later[0] != begun
    choice.begin(0, np.random.SeedSequence(5))
    again = rows(choice.fired(nothing, every, np.array([0, 2])))
    assert again[0] == begun
    assert again[1] not in (begun, later[1])
