"""The random floor: words of Philox, uniform cells, the same order for every reader."""

from collections import Counter
from itertools import permutations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.core.firing.base import top_up
from care_sim.core.firing.floor import Floor, draw_cells, floor_key
from care_sim.core.firing.listing import hardware_of
from care_sim.core.grid import AngularGrid
from tests.helpers.floors import drawn_cells, drawn_floors, floor_order, philox

LIKELY = 4.0
"""Chi-square goes beyond so many standard deviations once in thousands of draws."""


@pytest.mark.parametrize(
    ("counter", "key", "words"),
    [
        ((0,) * 4, (0,) * 2, "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ((2**32 - 1,) * 4, (2**32 - 1,) * 2, "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            "d16cfe09 94fdcceb 5001e420 24126ea1",
        ),
    ],
)
def test_the_reference_gives_the_known_answers_of_philox(counter, key, words):
    """`kat_vectors` of Random123, the library of the paper's authors."""
    assert " ".join(f"{int(word):08x}" for word in philox(counter, key)) == words


@given(
    drawn_floors,
    st.integers(1, 70) | st.sampled_from([16384, 2**16 + 1, 262144, 2**24, 3 * 2**29]),
    st.integers(1, 5),
)
def test_cells_are_those_of_the_reference(floor, size, batches):
    found = np.concatenate([draw_cells(floor, batch, size) for batch in range(batches)])
    assert found.tolist() == drawn_cells(floor, size, batches).tolist()


@given(drawn_floors, st.sets(st.integers(0, 399)), st.integers(0, 400))
@example(Floor(1, 2, 3), {5, 6}, 400)
def test_a_reader_takes_the_first_free_cells_of_the_order(floor, demanded, budget):
    """A whole order of so many cells takes many batches."""
    order = floor_order(floor, 400).tolist()
    assert sorted(order) == [*range(400)]
    chosen = np.isin(np.arange(400), [*demanded])
    count = top_up(floor, np.arange(400), chosen, len(demanded), budget)
    free = [cell for cell in order if cell not in demanded]
    expected = demanded.union(free[: max(0, budget - len(demanded))])
    assert set(np.flatnonzero(chosen).tolist()) == expected
    assert count == len(expected)


def deviation(counts, kinds):
    """By how many standard deviations the chi-square of counts exceeds that of equal chances."""
    expected = sum(counts.values()) / kinds
    squares = sum((count - expected) ** 2 / expected for count in counts.values())
    squares += expected * (kinds - len(counts))
    return (squares - (kinds - 1)) / np.sqrt(2 * (kinds - 1))


def test_every_order_of_four_cells_is_equally_frequent():
    """Over keyframes, and over the first and the second word of the key."""
    kinds = len([*permutations(range(4))])
    for turn in range(3):
        floors = (Floor(*np.roll([number, 5, 6], turn).tolist()) for number in range(960))
        counts = Counter(tuple(floor_order(floor, 4).tolist()) for floor in floors)
        assert abs(deviation(counts, kinds)) < LIKELY


def test_every_cell_of_a_grid_is_equally_frequent():
    cells = np.concatenate([draw_cells(Floor(7, 8, k), 0, 16384) for k in range(1280)])
    counts = Counter(cells.tolist())
    assert len(cells) == 10 * 16384
    assert abs(deviation(counts, 16384)) < LIKELY


def test_no_cell_is_drawn_more_often_because_the_words_do_not_divide():
    """With 2^32 words one of three of so many cells would have 2, and the others 3."""
    cells = np.concatenate([draw_cells(Floor(7, 8, k), 0, 3 * 2**29) for k in range(40)])
    assert abs(deviation(Counter((cells % 3).tolist()), 3)) < LIKELY


@given(st.integers(0, 2**64), st.integers(1, 4))
def test_number_0_is_the_floor_of_the_seed_and_others_those_of_its_children(entropy, number):
    seed = np.random.SeedSequence(entropy, spawn_key=(2,))
    assert [*floor_key(seed, 0)] == seed.generate_state(2).tolist()
    own = floor_key(seed, number)
    assert seed.n_children_spawned == 0
    assert [*own] == seed.spawn(number)[-1].generate_state(2).tolist()


@pytest.mark.parametrize("name", ["cells", "tiles:2x2"])
def test_a_budget_beyond_the_grid_fires_all_of_it(name):
    grid = AngularGrid(columns=8, rows=4)
    scores = np.zeros(grid.shape, np.float32)
    fired = hardware_of(name, grid).fire(scores, grid.size + 9, Floor(1, 2, 3), np.empty(0, int))
    assert fired.tolist() == [*range(grid.size)]
