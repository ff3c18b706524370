"""What the cameras of many worlds show is what each single loop sees, to the last bit."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.batch.camera_faults import BatchDelay, BatchMisses, Detected, DrawnAhead
from care_sim.batch.sight import Sight
from care_sim.batch.state import BatchState, load
from care_sim.core.conditions import CameraFaults
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera_faults import Delay, Misses
from care_sim.sensors.picture_timing import PictureTiming

FAULTS = {
    "false_negative_rate": 0.2,
    "false_negative_per_m": 0.01,
    "false_negative_burst": 3,
    "camera_latency": 1,
    "camera_jitter": 2,
    "blackout_start_s": 2.0,
    "blackout_s": 0.5,
    "camera_confidence": 0.4,
}


class Watched:
    """Single environments that fire nothing of their own, and a batch that sees their worlds."""

    def __init__(self, name, seeds, **arguments):
        self.envs = [gymnasium.make(f"CARE-{name}-v0", **arguments).unwrapped for _ in seeds]
        self.rig = self.envs[0].rig
        self.state = BatchState(len(seeds))
        self.sight = Sight(self.rig, [env.conditions for env in self.envs])
        self.begin(dict(enumerate(seeds)))

    def begin(self, seeds):
        for world, seed in seeds.items():
            env = self.envs[world]
            env.reset(seed=seed)
            load(self.state, world, env.loop.world)
            # The streams of the episode, as `reset` takes them.
            _, camera, *_ = env._streams(seed, count=5)
            self.sight.begin(world, env.loop.world, camera)
        self.state.live[:] = False
        self.state.live[[*seeds]] = True

    def step(self, worlds):
        """A keyframe of some of the worlds."""
        self.state.live[:] = False
        for world in worlds:
            env = self.envs[world]
            _, _, terminated, truncated, _ = env.step(np.zeros(self.rig.grid.shape, np.float32))
            self.state.live[world] = True
            if terminated or truncated:
                yield world

    def look(self):
        state = self.state
        for world in np.flatnonzero(state.live).tolist():
            built, sensor = self.envs[world].loop.world, self.envs[world].loop.sensor
            count = len(built.bullet.primitives.poses)
            state.bodies.boxes[world, :count] = built.boxes_of(np.arange(count))
            state.bodies.poses[world, :count] = built.bullet.primitives.poses
            state.times[world] = built.time
            state.sensors.poses[world, :4] = sensor.x, sensor.y, sensor.z, sensor.yaw
            state.sensors.turns[world] = np.cos(sensor.yaw), np.sin(sensor.yaw)
            state.sensors.turns_back[world] = sensor.turn_back
        return self.sight.look(state)

    def check(self):
        """Look, compare with the single loops, and return how many detections arrived."""
        arrived, shown = self.look()
        count = 0
        for world in np.flatnonzero(self.state.live).tolist():
            loop = self.envs[world].loop
            rows = arrived.rows[world, : arrived.counts[world]]
            assert rows.tobytes() == loop.belief.detections.rows().tobytes()
            bodies = range(self.state.bodies.counts[world])
            assert shown[world, : len(bodies)].tolist() == [loop.shows(body) for body in bodies]
            count += len(rows)
        return count

    def close(self):
        for env in self.envs:
            env.close()


@pytest.mark.parametrize("faults", [{}, FAULTS])
@pytest.mark.parametrize("name", ["Dense", "Dartout", "CutIn", "R157"])
def test_an_episode_is_that_of_the_single_loop(name, faults):
    watched = Watched(name, [3, 4, 5], **faults)
    arrived = watched.check()
    playing = {0, 1, 2}
    while playing:
        playing -= set(watched.step(sorted(playing)))
        arrived += watched.check()
    watched.close()
    assert arrived > 20


def test_worlds_begin_anew_while_others_go_on():
    watched = Watched("Dense", [1, 2], **FAULTS)
    watched.check()
    for keyframe in range(30):
        if keyframe == 12:
            watched.begin({0: 7})
            watched.check()
        list(watched.step([1] if keyframe % 5 == 4 else [0, 1]))
        watched.check()
    watched.close()


def test_several_cameras_see_in_their_order():
    watched = Watched("Dense", [1, 2], sensor="paper-vehicle", **FAULTS)
    watched.check()
    for _ in range(40):
        list(watched.step([0, 1]))
        watched.check()
    watched.close()


@given(st.integers(0, 2**32), st.integers(0, 12), st.integers(0, 9))
def test_numbers_drawn_ahead_are_those_of_single_draws(seed, objects, jitter):
    keyframes = 150
    ahead, late = DrawnAhead(1), DrawnAhead(1)
    one, other, first, second = (np.random.default_rng(seed) for _ in range(4))
    ahead.begin(0, lambda k: first.random((k, objects)))
    late.begin(0, lambda k: second.integers(jitter + 1, size=(k, 1)))
    live = np.ones(1, np.bool_)
    for _ in range(keyframes):
        assert ahead.next(live, 13)[0].tolist() == [*one.random(objects)] + [1.0] * (13 - objects)
        assert late.next(live, 1)[0, 0] == int(other.integers(jitter + 1))


@settings(max_examples=30)
@given(
    st.integers(0, 1000),
    st.lists(
        st.builds(
            CameraFaults,
            false_negative_rate=st.just(0.0) | st.floats(0, 1),
            false_negative_per_m=st.just(0.0) | st.floats(0, 0.1),
            false_negative_burst=st.integers(1, 5),
        ),
        min_size=3,
        max_size=3,
    ),
)
def test_the_misses_are_those_of_one_world(seed, faults):
    sizes = [3, 0, 7]
    together = BatchMisses(faults)
    apart = []
    for world, size in enumerate(sizes):
        together.begin(world, np.random.SeedSequence((seed, world)), size)
        rng = np.random.default_rng(np.random.SeedSequence((seed, world)))
        apart.append(Misses(size, faults[world], rng))
    rng = np.random.default_rng(seed)
    for _ in range(20):
        ranges, live = rng.uniform(0, 60, (3, 7)), rng.random(3) < 0.7
        if not together.any:
            continue
        missed = together.draw(live, ranges)
        for world in np.flatnonzero(live).tolist():
            size = sizes[world]
            expected = apart[world].draw(ranges[world, :size])
            assert missed[world, :size].tolist() == expected.tolist()


@settings(max_examples=40)
@given(
    st.integers(0, 1000),
    *[st.tuples(st.integers(0, most), st.integers(0, most)) for most in (3, 4)],
)
def test_what_is_late_arrives_as_in_one_world(seed, latencies, jitters):
    seeds = [np.random.SeedSequence((seed, world)) for world in range(2)]
    together = BatchDelay(np.array(latencies), np.array(jitters), 0.1)
    apart = []
    for world in range(2):
        together.begin(world, seeds[world])
        rng = np.random.default_rng(seeds[world])
        apart.append(Delay(PictureTiming(latencies[world], 0.0), jitters[world], 0.1, rng))
    rng = np.random.default_rng(seed)
    for _ in range(25):
        live = rng.random(2) < 0.8
        counts, rows, headings = rng.integers(0, 4, 2), rng.random((2, 3, 9)), rng.random(2)
        # A picture of a rendered world is new when it is taken.
        rows[:, :, ImageDetections.AGE :] = 0.0
        arrived = together.newest(live, Detected(counts, rows), headings)
        for world in np.flatnonzero(live).tolist():
            taken = ImageDetections.from_checked_rows(rows[world, : counts[world]].copy())
            bodies = np.zeros(counts[world], np.int64)
            apart[world].take(IdentifiedDetections(taken, bodies), headings[world])
            expected = apart[world].newest(headings[world]).detections.rows()
            assert arrived.rows[world, : arrived.counts[world]].tolist() == expected.tolist()
