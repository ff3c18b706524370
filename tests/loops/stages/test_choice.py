"""All worlds together fire what each fires alone, with any hardware."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.firing.floor import Floor, floor_key
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.loops.stages.choice import Choice

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


HARDWARE = st.sampled_from(["cells", "rows", "energy:3", "vertical-window"])
budgets = st.lists(st.integers(1, GRID.size), min_size=WORLDS, max_size=WORLDS)


def rows(fired):
    counts, cells = fired
    return [row[:count].tolist() for count, row in zip(counts, cells, strict=True)]


def at(*cells):
    """The scores of an action that demands these cells alone."""
    return [float(cell in cells) for cell in range(GRID.size)]


# A window stays where it stood, in each world, if nothing is demanded.
STANDING = [([at(0), at(16), at(32)], [True] * 3), ([at()] * 3, [True] * 3)]


# The floor of a later keyframe, of free cells and of whole units.
UNASKED = [([at()] * 3, [True, False, True])] * 3


@example(STANDING, [16] * 3, False, 0, "vertical-window")
@example(UNASKED, [5, 8, 9], True, 1, "cells")
@example(UNASKED, [16] * 3, True, 0, "rows")
@given(keyframes, budgets, st.booleans(), st.integers(0, 2), HARDWARE)
def test_every_world_fires_as_if_alone(played, budgets, floor, floor_seed, firing):
    rig = Rig(GRID, firing=firing)
    conditions = ClosedLoopConditions(floor=floor, floor_seed=floor_seed)
    rigs = [Rig(GRID, budget=budget, firing=firing) for budget in budgets]
    choice = Choice(rigs, conditions)
    keys, last = [], [NOTHING] * WORLDS
    for world in range(WORLDS):
        choice.begin(world, np.random.SeedSequence(world))
        keys.append(floor_key(np.random.SeedSequence(world), floor_seed))
    now = np.zeros(WORLDS, np.int64)
    for given_scores, live in played:
        action = np.array(given_scores, np.float32).reshape(WORLDS, *GRID.shape)
        alone = [[]] * WORLDS
        for world in np.flatnonzero(live).tolist():
            drawn = Floor(*keys[world], now[world]) if floor else None
            given_ones = action[world], budgets[world], drawn, last[world]
            last[world] = rig.hardware.fire(*given_ones)
            alone[world] = last[world].tolist()
        assert rows(choice.fired(action, np.array(live), now)) == alone
        now += live


@pytest.mark.parametrize("firing", ["cells", "rows"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_scores_that_are_not_finite_are_refused_where_a_world_plays(firing, wrong):
    choice = Choice([Rig(GRID, budget=8, firing=firing)] * WORLDS, ClosedLoopConditions())
    action = np.zeros((WORLDS, *GRID.shape), np.float32)
    action[1, -1, -1] = wrong
    now = np.zeros(WORLDS, np.int64)
    with pytest.raises(InvalidInput, match="NaN or infinity"):
        choice.fired(action, np.ones(WORLDS, bool), now)
    assert choice.fired(action, np.array([True, False, True]), now).counts.tolist() == [8, 0, 8]
