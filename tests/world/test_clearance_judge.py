"""One client tells of bodies what the client of their own world tells, to the last bit."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.world import contact
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import BulletWorld
from care_sim.world.bullet_bodies import pybullet
from care_sim.world.contact import ClearanceJudge, judge_here

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


@pytest.mark.parametrize("x", [3.0, 60.0, 104.0])
def test_of_bodies_that_lie_on_their_side_all_parts_are_asked_about(judge, x):
    # The head, which is the highest part of who stands, points to the car.
    lying = Frame(x, 1.0, 0.5, np.pi, 0.0, 1.5)
    with closing(BulletWorld()) as world:
        ego = world.add(CATALOGUE["ego"], (0.0, 0.0, 0.1), transparent=True)
        body = world.add(CATALOGUE["pedestrian"], lying)
        pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE["pedestrian"])
        poses = world.primitives.poses[[ego, body]]
        assert judge.clearance(pair, poses) == world.clearance(ego, body)


def test_pybullet_is_asked_about_the_parts_that_could_be_the_nearest(judge, monkeypatch):
    asked = []
    exactly = judge._bodies.clearance
    monkeypatch.setattr(judge._bodies, "clearance", lambda *its: asked.append(1) or exactly(*its))
    pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE["pedestrian"])
    upright = [0.0, 0.0, 0.0, 1.0]
    near = [[0.0, 0.0, 0.0, *upright], [12.0, 0.0, 0.0, *upright]]
    # The hind leg is nearer than the trunk, and the car's front than its cabin.
    hind_m = 0.285 + 0.16 / 2
    assert judge.clearance(pair, near) == pytest.approx(12.0 - 4.08 / 2 - hind_m, abs=1e-3)
    assert len(asked) == 1
    # Where all lies in each other, nothing tells what is nearest.
    assert judge.clearance(pair, [near[0], near[0]]) < 0
    assert len(asked) > 2


def test_two_of_one_kind_are_not_one(judge):
    pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE["ego"])
    upright = [0.0, 0.0, 0.0, 1.0]
    poses = [[x, 0.0, 0.0, *upright] for x in (0.0, 10.0)]
    apart = 10.0 - CATALOGUE["ego"].size[0]
    assert judge.clearance(pair, poses) == pytest.approx(apart, abs=0.01)
    assert np.isinf(judge.clearance(pair, poses, within=1.0))


def ahead_by_ten(judge, kind):
    pair = judge.stand_ins(CATALOGUE["ego"], kind)
    return judge.clearance(pair, [[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for x in (0.0, 10.0)])


def test_worlds_of_a_thread_share_a_judge_and_threads_do_not():
    with ThreadPoolExecutor(1) as thread:
        other = thread.submit(judge_here).result()
        assert thread.submit(judge_here).result() is other
    assert judge_here() is judge_here() is not other


@pytest.mark.parametrize("end", [pybullet.disconnect, pybullet.resetSimulation])
def test_a_judge_whose_client_somebody_else_ends_is_replaced(end):
    told = ahead_by_ten(judge_here(), CATALOGUE["car"])
    lost = judge_here()
    end(physicsClientId=lost._client.number)
    assert judge_here() is not lost
    assert ahead_by_ten(judge_here(), CATALOGUE["car"]) == told


def test_a_judge_that_was_closed_before_it_was_asked_is_replaced():
    def ask():
        judge_here().close()
        return ahead_by_ten(judge_here(), CATALOGUE["car"])

    # In a thread where none has been asked.
    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(ask).result() == ahead_by_ten(judge_here(), CATALOGUE["car"])


def test_a_judge_of_many_kinds_is_replaced(monkeypatch):
    monkeypatch.setattr(contact, "MOST_KINDS", 3)

    def ask(name):
        judge = judge_here()
        ahead_by_ten(judge, CATALOGUE[name])
        return judge

    # In a thread where none has been asked: the ego and two others are three.
    with ThreadPoolExecutor(1) as thread:
        first, second, *others = thread.map(ask, KINDS)
    assert first is second
    assert len({first, *others}) == len(KINDS) // 2
