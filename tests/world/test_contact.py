"""Contact and clearance."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.world.bodies import CATALOGUE
from care_sim.world.body_tables import Footprints
from care_sim.world.bullet import BulletWorld
from care_sim.world.bullet_bodies import pybullet
from care_sim.world.clearances import Clearances
from care_sim.world.contact import PADDING_M, ClearanceJudge, borrow_judge, least_gap

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
            poses = world.primitives.poses[None, [ego, body]]
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
        poses = world.primitives.poses[None, [ego, body]]
        assert judge.clearance(pair, poses) == world.clearance(ego, body)


@pytest.fixture
def asked(monkeypatch):
    """An entry for every pair of parts that PyBullet is asked about."""
    pairs = []
    exactly = pybullet.getClosestPoints
    monkeypatch.setattr(pybullet, "getClosestPoints", lambda *its: pairs.append(1) or exactly(*its))
    return pairs


def test_pybullet_is_asked_about_the_parts_that_could_be_the_nearest(judge, asked):
    pair = judge.stand_ins(CATALOGUE["ego"], CATALOGUE["pedestrian"])
    upright = [0.0, 0.0, 0.0, 1.0]
    near = np.array([[[0.0, 0.0, 0.0, *upright], [12.0, 0.0, 0.0, *upright]]])
    # The hind leg is nearer than the trunk, and the car's front than its cabin.
    hind_m = 0.285 + 0.16 / 2
    assert judge.clearance(pair, near) == pytest.approx(12.0 - 4.08 / 2 - hind_m, abs=1e-3)
    assert len(asked) == 1
    # Where all lies in each other, nothing tells what is nearest.
    assert judge.clearance(pair, near[:, [0, 0]]) < 0
    assert len(asked) > 2


def ahead_by_ten(judge, kind):
    pair = judge.stand_ins(CATALOGUE["ego"], kind)
    poses = [[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for x in (0.0, 10.0)]
    return judge.clearance(pair, np.array([poses]))


def test_worlds_of_a_thread_share_a_judge_and_threads_do_not():
    with ThreadPoolExecutor(1) as thread:
        other = thread.submit(borrow_judge).result()
        assert thread.submit(borrow_judge).result() is other
    assert borrow_judge() is borrow_judge() is not other


@pytest.mark.parametrize("end", [pybullet.disconnect, pybullet.resetSimulation])
def test_a_judge_whose_client_somebody_else_ends_is_replaced(end):
    told = ahead_by_ten(borrow_judge(), CATALOGUE["car"])
    lost = borrow_judge()
    end(physicsClientId=lost._client.number)
    assert borrow_judge() is not lost
    assert ahead_by_ten(borrow_judge(), CATALOGUE["car"]) == told


PAIRED = ("adult", "bicycle", "car", "motorcycle", "pedestrian", "trailer", "truck", "van", "hedge")
POSES = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-7.0, 7.0))


class Pair:
    """The ego and another body."""

    def __init__(self, kind):
        self.world = BulletWorld()
        self.footprints = Footprints()
        self.clearances = Clearances(1, 4)
        self.clearances.begin(0, (CATALOGUE["ego"], CATALOGUE[kind]))
        self.steps = np.zeros(1, int)
        start = (0.0, 0.0, 0.0)
        self.bodies = []
        for each in (CATALOGUE["ego"], CATALOGUE[kind]):
            self.bodies.append(self.world.add(each, start))
            self.footprints.add(self.bodies[-1], each.size, start)

    def close(self):
        self.world.close()

    def note(self):
        self.steps += 1
        own, other = ([body] for body in self.bodies)
        tables = self.footprints.boxes[None], self.world.primitives.poses[None]
        whose = np.array(own), np.array(other)
        self.clearances.note(np.ones(1, bool), self.steps, *tables, whose, np.full(1, np.inf))

    def least(self):
        count = int(self.steps[0])
        of_all = self.clearances.least(0, 1, count + 1)
        told = self.clearances.least_since(self.steps, count, np.ones(1, bool), np.inf)
        assert told.tolist() == [of_all]
        return of_all

    def put(self, *poses):
        table = np.array(poses)
        self.world.move_all(np.array(self.bodies), table)
        self.footprints.move_all(np.array(self.bodies), table)

    @property
    def boxes(self):
        return self.footprints.boxes[self.bodies]


# A simulator an example: to shrink one takes hundreds of them.
@settings(deadline=None, max_examples=60, phases=set(Phase) - {Phase.shrink})
@given(st.sampled_from(PAIRED), st.lists(st.tuples(POSES, POSES), min_size=1, max_size=4))
def test_the_least_of_all_moments_is_that_of_asking_at_each(kind, moments):
    with closing(Pair(kind)) as pair:
        each = []
        for poses in moments:
            pair.put(*poses)
            pair.note()
            each.append(pair.world.clearance(*pair.bodies))
            assert least_gap(*pair.boxes) - PADDING_M <= each[-1]
        assert pair.least() == min(each)


def test_of_two_that_come_nearer_only_the_last_moment_is_asked_about(asked):
    with closing(Pair("pedestrian")) as pair:
        for x in (9.0, 8.6, 8.2):
            pair.put((0.0, 0.0, 0.0), (x, 1.0, np.pi / 2))
            pair.note()
        assert pair.least() == pytest.approx(8.2 - 2.04 - 0.33, abs=0.01)
        # One pair of parts, by `least` and by `least_since`.
        assert len(asked) == 2
