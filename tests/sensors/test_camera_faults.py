"""Faults of the cameras of many worlds are those of each alone."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.core.arrays import ONE_WORLD
from care_sim.core.conditions import CameraFaults
from care_sim.sensors.camera_faults import Delay, Detected, DrawnAhead, Misses


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
    together = Misses(faults)
    apart = []
    for world, size in enumerate(sizes):
        together.begin(world, np.random.SeedSequence((seed, world)), size)
        apart.append(Misses([faults[world]]))
        apart[world].begin(0, np.random.SeedSequence((seed, world)), size)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        ranges, live = rng.uniform(0, 60, (3, 7)), rng.random(3) < 0.7
        missed = together.draw(live, ranges)
        for world in np.flatnonzero(live).tolist():
            size = sizes[world]
            expected = apart[world].draw(ONE_WORLD, ranges[[world], :size])
            assert missed[[world], :size].tolist() == expected.tolist()


@settings(max_examples=40)
@given(
    st.integers(0, 1000),
    *[st.tuples(st.integers(0, most), st.integers(0, most)) for most in (3, 4)],
)
def test_what_is_late_arrives_as_in_one_world(seed, latencies, jitters):
    seeds = [np.random.SeedSequence((seed, world)) for world in range(2)]
    together = Delay(np.array(latencies), np.array(jitters), 0.1)
    apart = []
    for world in range(2):
        together.begin(world, seeds[world])
        late = np.array([latencies[world]]), np.array([jitters[world]])
        apart.append(Delay(*late, 0.1))
        apart[world].begin(0, seeds[world])
    rng = np.random.default_rng(seed)
    for _ in range(25):
        live = rng.random(2) < 0.8
        counts, rows, headings = rng.integers(0, 4, 2), rng.random((2, 3, 9)), rng.random(2)
        objects = rng.integers(9, size=(2, 3))
        together.take(live, Detected(counts, rows, objects), headings)
        arrived = together.newest(live, headings)
        for world in np.flatnonzero(live).tolist():
            own = [table[[world]] for table in (counts, rows, objects)]
            apart[world].take(ONE_WORLD, Detected(*own), headings[[world]])
            expected = apart[world].newest(ONE_WORLD, headings[[world]]).take(0)
            found = arrived.take(world)
            assert found.detections.rows().tolist() == expected.detections.rows().tolist()
            assert found.objects.tolist() == expected.objects.tolist()
