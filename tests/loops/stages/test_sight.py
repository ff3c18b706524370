"""What the cameras of many worlds show is what each single loop sees, to the last bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.core.conditions import CameraFaults
from care_sim.core.types import ImageDetections
from care_sim.loops.stages.camera_faults import BatchDelay, BatchMisses, Detected, DrawnAhead
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import Delay, Misses, PictureTiming


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
        objects = rng.integers(9, size=(2, 3))
        arrived = together.newest(live, Detected(counts, rows, objects), headings)
        for world in np.flatnonzero(live).tolist():
            taken = ImageDetections.from_checked_rows(rows[world, : counts[world]].copy())
            bodies = objects[world, : counts[world]].copy()
            apart[world].take(IdentifiedDetections(taken, bodies), headings[world])
            expected = apart[world].newest(headings[world])
            own = slice(arrived.counts[world])
            assert arrived.rows[world, own].tolist() == expected.detections.rows().tolist()
            assert arrived.objects[world, own].tolist() == expected.objects.tolist()
