"""The floor is NumPy's own permutation, drawn by code of ours."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.core.firing.floor import RandomFloor


def of_numpy(seed, number, cells, count):
    """The floors as NumPy draws them, from the seed itself or from one of its children."""
    own = seed.spawn(number)[-1] if number else seed
    rng = np.random.default_rng(own)
    return [rng.permutation(cells).tolist() for _ in range(count)]


@settings(deadline=None)
@given(st.integers(0, 2**64), st.integers(0, 3), st.integers(1, 70), st.integers(1, 5))
def test_floors_of_few_cells_are_those_of_numpy(seed, number, cells, count):
    """So few that every size of the mask, and its edges, are met."""
    floor = RandomFloor(np.random.SeedSequence(seed), number, cells)
    ours = [floor.at(keyframe).tolist() for keyframe in range(count)]
    assert ours == of_numpy(np.random.SeedSequence(seed), number, cells, count)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**64), st.sampled_from([4095, 4096, 4097, 16384, 20000, 65536]))
def test_floors_of_whole_grids_are_those_of_numpy(seed, cells):
    """Each takes several draws of the generator, and begins with what the one before left over."""
    floor = RandomFloor(np.random.SeedSequence(seed), 0, cells)
    ours = [floor.at(keyframe).tolist() for keyframe in range(3)]
    assert ours == of_numpy(np.random.SeedSequence(seed), 0, cells, 3)


def test_a_floor_of_more_cells_than_16_bits_count_is_that_of_numpy():
    floor = RandomFloor(np.random.SeedSequence(3), 0, 2**16 + 1)
    (wanted,) = of_numpy(np.random.SeedSequence(3), 0, 2**16 + 1, 1)
    assert floor.at(0).tolist() == wanted


def test_a_floor_that_nobody_asked_for_is_drawn_all_the_same():
    every, late = (RandomFloor(np.random.SeedSequence(5), 1, 100) for _ in range(2))
    floors = [every.at(keyframe).tolist() for keyframe in range(4)]
    assert late.at(3).tolist() == floors[3]
    assert late.at(3).tolist() == floors[3]
