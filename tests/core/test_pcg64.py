"""The random words are those of NumPy's PCG64, whichever worlds were drawn for before."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.firing.floor import refill, seed_stream, word_streams


@given(st.integers(0, 2**128 - 1), st.integers(1, 60))
def test_the_numbers_are_those_of_numpy(seed, times):
    streams = word_streams(1)
    seed_stream(streams, 0, np.random.SeedSequence(seed))
    wanted = np.random.PCG64(np.random.SeedSequence(seed))
    for _ in range(times):
        refill(streams, 0)
        assert np.array_equal(streams.numbers[0], wanted.random_raw(streams.numbers.shape[1]))


def test_every_number_gives_its_lower_half_first():
    streams = word_streams(1)
    seed_stream(streams, 0, np.random.SeedSequence(1))
    refill(streams, 0)
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(1)))
    drawn = generator.integers(0, 2**32, streams.words.shape[1], dtype=np.uint32)
    assert np.array_equal(streams.words[0], drawn)


@given(st.lists(st.integers(0, 2), max_size=8))
def test_worlds_do_not_disturb_each_other(order):
    streams = word_streams(3)
    wanted = [np.random.PCG64(np.random.SeedSequence(seed)) for seed in range(3)]
    for world in range(3):
        seed_stream(streams, world, np.random.SeedSequence(world))
    for world in order:
        refill(streams, world)
        numbers = wanted[world].random_raw(streams.numbers.shape[1])
        assert np.array_equal(streams.numbers[world], numbers)
