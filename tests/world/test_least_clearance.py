"""PyBullet is asked about few moments, and the least clearance of all stays what it is."""

from contextlib import closing

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from care_sim.world.bodies import CATALOGUE
from care_sim.world.body_tables import Footprints
from care_sim.world.bullet import BulletWorld
from care_sim.world.contact import PADDING_M, ClearanceJudge, LeastClearance, least_gap

KINDS = ("adult", "bicycle", "car", "motorcycle", "pedestrian", "trailer", "truck", "van", "hedge")
POSES = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-7.0, 7.0))


class Pair:
    """The ego and another body, and how often a judge was asked about them."""

    def __init__(self, kind):
        self.world = BulletWorld()
        self.footprints = Footprints()
        self.judge = ClearanceJudge()
        self.least = LeastClearance(self.judge, CATALOGUE["ego"], CATALOGUE[kind])
        self.asked = 0
        start = (0.0, 0.0, 0.0)
        self.bodies = []
        for each in (CATALOGUE["ego"], CATALOGUE[kind]):
            self.bodies.append(self.world.add(each, start))
            self.footprints.add(self.bodies[-1], each.size, start)
        exact = self.judge.clearance

        def clearance(*pair):
            self.asked += 1
            return exact(*pair)

        self.judge.clearance = clearance

    def close(self):
        self.world.close()
        self.judge.close()

    def note(self):
        self.least.note(self.boxes, self.world.primitives.poses[self.bodies])

    def put(self, *poses):
        table = np.array(poses)
        self.world.move_all(np.array(self.bodies), table)
        self.footprints.move_all(np.array(self.bodies), table)

    @property
    def boxes(self):
        return self.footprints.boxes[self.bodies]


# A simulator an example: to shrink one takes hundreds of them.
@settings(deadline=None, max_examples=60, phases=set(Phase) - {Phase.shrink})
@given(st.sampled_from(KINDS), st.lists(st.tuples(POSES, POSES), min_size=1, max_size=4))
def test_the_least_of_all_moments_is_that_of_asking_at_each(kind, moments):
    with closing(Pair(kind)) as pair:
        each = []
        for poses in moments:
            pair.put(*poses)
            pair.note()
            each.append(pair.world.clearance(*pair.bodies))
            assert least_gap(*pair.boxes) - PADDING_M <= each[-1]
        assert pair.least.metres() == min(each)


def test_of_two_that_come_nearer_only_the_last_moment_is_asked_about():
    with closing(Pair("pedestrian")) as pair:
        for x in (9.0, 8.6, 8.2):
            pair.put((0.0, 0.0, 0.0), (x, 1.0, np.pi / 2))
            pair.note()
        assert pair.least.metres() == pytest.approx(8.2 - 2.04 - 0.33, abs=0.01)
        assert pair.asked == 1


def test_without_a_moment_nothing_is_near():
    with closing(Pair("car")) as pair:
        assert pair.least.metres() == np.inf
