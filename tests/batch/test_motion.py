"""Worlds in a batch move as each does alone, to the last bit."""

from contextlib import ExitStack, closing

import numpy as np
import pytest

from care_sim.batch.loading import load
from care_sim.batch.motion import KNOWN_BELOW_M, Motion, steps_of
from care_sim.batch.state import BatchState
from care_sim.core.types import Ego
from care_sim.scenarios import make_scenario

KEYFRAME_S = 0.1
KEYFRAMES = 60
COLLISION_COURSE = {"encroachment_s": (-0.3, -0.1)}
SCENARIOS = [
    ("dartout", {"mirrored": "drawn"}),
    ("dartout", COLLISION_COURSE),
    ("dense", {"mirrored": "drawn"}),
    ("dense", COLLISION_COURSE),
    ("cutin", {"mirrored": "drawn"}),
    ("r157", {}),
]
NOT_TOGETHER = {"cutin"}
"""Whose worlds move by their own Python."""


class Batch:
    """Worlds of a scenario, moved in a batch, and their like, each moved alone."""

    def __init__(self, scenario, seeds):
        self.state = BatchState(len(seeds))
        self.motion = Motion(len(seeds), steps_of(KEYFRAMES * KEYFRAME_S, KEYFRAME_S))
        self.alone = [None] * len(seeds)
        self._scenario = scenario
        for world, seed in enumerate(seeds):
            self.begin(world, seed)

    def begin(self, world, seed):
        if self.alone[world] is not None:
            self.alone[world].close()
        self.alone[world], built = (
            self._scenario.build(np.random.default_rng(seed)) for _ in range(2)
        )
        load(self.state, world, built)
        self.motion.begin(world, built)
        self.state.live[world] = True

    def assert_same(self, world):
        alone, state = self.alone[world], self.state
        count = state.bodies.counts[world]
        boxes = alone.boxes_of(np.arange(count))
        assert state.bodies.boxes[world, :count].tobytes() == boxes.tobytes()
        poses = alone.bullet.primitives.poses
        assert state.bodies.poses[world, :count].tobytes() == poses.tobytes()
        assert state.bodies.before[world, :count].tobytes() == alone._before.tobytes()
        assert state.times[world] == alone.time
        egos = state.egos
        ego = Ego(egos.speeds[world], egos.yaw_rates[world], egos.accelerations[world])
        assert ego == alone.ego_motion

    def close(self):
        self.motion.close()
        for world in self.alone:
            world.close()


def assert_passage(passages, world, passage):
    assert passages.nearest_m[world] == passage.nearest_m
    assert passages.clearance_m[world] == passage.clearance_m
    assert passages.hit[world] == (passage.impact is not None)
    if passage.impact is not None:
        assert passages.impact_speed_mps[world] == passage.impact.speed_mps
        assert passages.body[world] == passage.impact.body
        assert passages.ahead[world] == passage.impact.at_front


@pytest.mark.parametrize(("name", "physics"), SCENARIOS)
def test_worlds_move_as_alone_whatever_their_egos_do(name, physics):
    """Half of the worlds begin anew on the way, and not all are live at every keyframe."""
    rng = np.random.default_rng(5)
    worlds, hits = 8, 0
    with closing(Batch(make_scenario(name, **physics), range(worlds))) as batch:
        assert len(batch.motion._by_itself) == (worlds if name in NOT_TOGETHER else 0)
        steady = np.arange(worlds) % 2 == 0
        for keyframe in range(KEYFRAMES):
            if keyframe == 25:
                for world in range(0, worlds, 3):
                    batch.begin(world, 100 + world)
            batch.state.live[:] = rng.random(worlds) < 0.95
            accelerations = np.where(steady, 0.0, rng.uniform(-4.0, 3.5, worlds))
            passages = batch.motion.advance(batch.state, accelerations, KEYFRAME_S)
            for world in np.flatnonzero(batch.state.live).tolist():
                passage = batch.alone[world].advance(float(accelerations[world]), KEYFRAME_S)
                assert_passage(passages, world, passage)
                hits += passage.impact is not None
            for world in range(worlds):
                batch.assert_same(world)
    assert hits or physics is not COLLISION_COURSE


@pytest.mark.parametrize("name", ["dartout", "cutin"])
def test_clearances_that_are_put_off_are_settled_in_the_end(name):
    with closing(Batch(make_scenario(name), range(4))) as batch:
        clearances, bounds = [], []
        for _ in range(KEYFRAMES):
            passages = batch.motion.advance(batch.state, np.zeros(4), KEYFRAME_S, exact=False)
            bounds.append(passages.clearance_m)
            clearances.append([one.advance(0.0, KEYFRAME_S).clearance_m for one in batch.alone])
        exact, told = np.array(clearances), np.array(bounds)
        assert (told <= exact).all()
        assert ((told == exact) | (told > KNOWN_BELOW_M)).all()
        assert (told < exact).any()
        for world in range(4):
            for begin in (0, 20, 55):
                least = batch.motion.settle(world, since_s=begin * KEYFRAME_S)
                assert least == exact[begin:, world].min()


def test_of_a_world_without_somebody_it_is_about_nothing_is_near():
    with ExitStack() as stack:
        batch = stack.enter_context(closing(Batch(make_scenario("dartout"), [3])))
        built = make_scenario("dartout").build(np.random.default_rng(3))
        stack.callback(built.close)
        built.first_sighting = None
        load(batch.state, 0, built)
        batch.motion.begin(0, built)
        passages = batch.motion.advance(batch.state, np.zeros(1), KEYFRAME_S)
        assert (passages.nearest_m[0], passages.clearance_m[0]) == (np.inf, np.inf)
        assert batch.motion.settle(0) == np.inf
