"""Worlds that move together move as each does alone, to the last bit."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.core.types import Ego
from care_sim.envs.reward import KEEP_CLEAR_M
from care_sim.loops.stages.motion import Motion, steps_of
from care_sim.loops.stages.state import State, load
from care_sim.scenarios import make_scenario
from care_sim.world.bodies import CATALOGUE
from care_sim.world.contact import ClearanceJudge
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

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
"""Scenarios whose worlds move by their own Python."""


class Batch:
    """Worlds, moved in a batch, and their like, each moved alone."""

    def __init__(self, *builds):
        self.state = State(len(builds))
        self.motion = Motion(len(builds), steps_of(KEYFRAMES * KEYFRAME_S, KEYFRAME_S))
        self.alone = [None] * len(builds)
        for world, build in enumerate(builds):
            self.begin(world, build)

    def begin(self, world, build):
        if self.alone[world] is not None:
            self.alone[world].close()
        self.alone[world], built = build(), build()
        load(self.state, world, built)
        self.motion.begin(world, built)
        self.state.live[world] = True

    def advance(self, accelerations):
        """Move the worlds that are live, in the batch and alone; the passages."""
        passages = self.motion.advance(self.state, accelerations, KEYFRAME_S)
        for world in np.flatnonzero(self.state.live).tolist():
            passage = self.alone[world].advance(float(accelerations[world]), KEYFRAME_S)
            assert_passage(passages, world, passage)
        for world in range(self.state.worlds):
            self.assert_same(world)
        return passages

    def assert_same(self, world):
        alone, state = self.alone[world], self.state
        assert_alike(self.motion.current(state, world), alone)
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
        for world in self.alone:
            world.close()


def assert_alike(world, other):
    """All that anybody may read off both is the same."""
    for read in (
        lambda one: (one.time, one.ego_motion, one.ego.pose, one.along_m, one.ego.speed),
        lambda one: [actor.pose_at(one.time) for actor in one.actors],
        lambda one: one._footprints.boxes.tobytes(),
        lambda one: one._before.tobytes(),
        lambda one: one.bullet.primitives.poses.tobytes(),
        lambda one: one.linear_motion().rates.tobytes(),
    ):
        assert read(world) == read(other)


def of(name, seed, **physics):
    scenario = make_scenario(name, **physics)
    return lambda: scenario.build(np.random.default_rng(seed))


def assert_passage(passages, world, passage):
    assert passages.nearest_m[world] == passage.nearest_m
    assert passages.clearance_m[world] == passage.clearance_m
    assert passages.hit[world] == (passage.impact is not None)
    if passage.impact is not None:
        assert passages.impact_speed_mps[world] == passage.impact.speed_mps
    assert passages.impacts.get(world) == passage.impact


@pytest.mark.parametrize(("name", "physics"), SCENARIOS)
def test_worlds_move_as_alone_whatever_their_egos_do(name, physics):
    """Half of the worlds begin anew on the way, and not all are live at every keyframe."""
    rng = np.random.default_rng(5)
    worlds, hits = 8, 0
    with closing(Batch(*(of(name, seed, **physics) for seed in range(worlds)))) as batch:
        assert len(batch.motion._by_itself) == (worlds if name in NOT_TOGETHER else 0)
        steady = np.arange(worlds) % 2 == 0
        for keyframe in range(KEYFRAMES):
            if keyframe == 25:
                for world in range(0, worlds, 3):
                    batch.begin(world, of(name, 100 + world, **physics))
            batch.state.live[:] = rng.random(worlds) < 0.95
            passages = batch.advance(np.where(steady, 0.0, rng.uniform(-4.0, 3.5, worlds)))
            hits += passages.hit[batch.state.live].sum()
    assert hits or physics is not COLLISION_COURSE


@pytest.mark.parametrize(("gap_m", "hit"), [(0.01, False), (-0.01, True)])
def test_only_a_contact_is_an_impact(gap_m, hit):
    def street():
        world = World(Traffic((1, -1), 0, 3.5, 14.0), ego_speed=10.0)
        aside = (world.ego_kind.size[1] + CATALOGUE["bus"].size[1]) / 2 + gap_m
        world.first_sighting = world.add("bus", "bus", (10.0, aside, 0.0))
        return world

    with closing(Batch(street)) as batch:
        passages = [batch.advance(np.zeros(1)) for _ in range(10)]
    assert any(passage.hit[0] for passage in passages) == hit
    assert min(passage.clearance_m[0] for passage in passages) == pytest.approx(gap_m, abs=5e-3)


@pytest.mark.parametrize("name", ["dartout", "cutin"])
def test_clearances_that_are_put_off_are_settled_in_the_end(name, monkeypatch):
    asked, clearances, bounds = [], [], []
    with closing(Batch(*(of(name, seed) for seed in range(4)))) as batch:
        exactly = ClearanceJudge.clearance
        monkeypatch.setattr(
            ClearanceJudge, "clearance", lambda *its: asked.append(1) or exactly(*its)
        )
        for _ in range(KEYFRAMES):
            passages = batch.motion.advance(batch.state, np.zeros(4), KEYFRAME_S, KEEP_CLEAR_M)
            bounds.append(passages.clearance_m.copy())
            count = len(asked)
            clearances.append([one.advance(0.0, KEYFRAME_S).clearance_m for one in batch.alone])
            del asked[count:]
        exact, told = np.array(clearances), np.array(bounds)
        assert (told <= exact).all()
        assert ((told == exact) | (told > KEEP_CLEAR_M)).all()
        assert (told < exact).any()
        for world in range(4):
            for begin in (0, 20, 55):
                least = batch.motion.settle(world, since_s=begin * KEYFRAME_S)
                assert least == exact[begin:, world].min()
    assert len(asked) < exact.size


def test_of_a_world_without_somebody_it_is_about_nothing_is_near():
    def nobody():
        world = of("dartout", 3)()
        world.first_sighting = None
        return world

    with closing(Batch(of("dartout", 3))) as batch:
        batch.advance(np.zeros(1))
        batch.begin(0, nobody)
        passages = batch.advance(np.zeros(1))
        assert (passages.nearest_m[0], passages.clearance_m[0]) == (np.inf, np.inf)
        assert batch.motion.settle(0) == np.inf
