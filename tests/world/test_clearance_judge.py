"""One client tells of bodies what the client of their own world tells, to the last bit."""

from contextlib import closing

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import BulletWorld
from care_sim.world.clearance_judge import ClearanceJudge

KINDS = ("pedestrian", "bicycle", "car", "bus", "trailer", "hoarding")
BODIES = st.lists(
    st.tuples(
        st.sampled_from(KINDS), st.floats(-12.0, 12.0), st.floats(-12.0, 12.0), st.floats(-7.0, 7.0)
    ),
    min_size=1,
    max_size=4,
)


@pytest.fixture(scope="module")
def judge():
    """One for all examples: whatever was asked before changes no answer."""
    with closing(ClearanceJudge()) as made:
        yield made


@settings(max_examples=40, phases=set(Phase) - {Phase.shrink})
@given(BODIES, st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)))
def test_it_tells_what_the_world_of_the_bodies_tells(judge, others, place):
    with closing(BulletWorld()) as world:
        bodies = [(world.add(CATALOGUE[name], pose), name) for name, *pose in others]
        ego = world.add(CATALOGUE["ego"], place, transparent=True)
        for body, name in bodies:
            pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE[name])
            poses = world.primitives.poses[[ego, body]].tolist()
            for within in (100.0, 0.5):
                clearance = judge.clearance(pair, poses, within)
                assert clearance == world.clearance(ego, body, within)


def test_two_of_one_kind_are_not_one(judge):
    pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE["ego"])
    upright = [0.0, 0.0, 0.0, 1.0]
    poses = [[x, 0.0, 0.0, *upright] for x in (0.0, 10.0)]
    apart = 10.0 - CATALOGUE["ego"].size[0]
    assert judge.clearance(pair, poses) == pytest.approx(apart, abs=0.01)
    assert np.isinf(judge.clearance(pair, poses, within=1.0))
