"""The map of `tuned-place`: objects by hand, and every choice tried."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.types import CLASSES
from care_sim.perception.measured.recall import recall
from care_sim.perception.measured.tables import measurement
from care_sim.training.supervised.tuned_place import (
    Frames,
    chance_table,
    frames_of,
    joined,
    tuned_order,
)
from tests.helpers.handmade_film import BEHIND, BESIDE, BUS, WALKER, handmade_film, returns_of

SIZE = 40
HALVES = np.array([[0.0, 0.5, 0.75, 0.875]])
"""Chances of one kind of object: every return halves what is missed."""
CELLS = st.lists(st.sets(st.integers(0, 5), min_size=1, max_size=3), min_size=1, max_size=4)


def frames(*cells, counts=None):
    sizes = np.array([len(own) for own in cells])
    counts = np.ones((len(cells), 4)) if counts is None else np.array(counts, float)
    kinds = np.zeros(len(cells), np.int64)
    return Frames(np.concatenate([sorted(own) for own in cells]), sizes, kinds, counts)


def test_the_cell_of_most_objects_comes_first_and_then_what_adds_to_others():
    given = frames([3, 7], [3, 8], [3, 9], [20])
    order, _ = tuned_order(given, HALVES, SIZE)
    assert order[:2].tolist() == [3, 20]
    assert {*order[2:5].tolist()} == {7, 8, 9}


def test_a_count_that_has_enough_waits_until_all_have():
    """Cell 38 gives one count 92%. Cell 39 would add 8% to it, each of thirteen others 7.7% to the
    other count, which has 92% with twelve of them.
    """
    cells = [[38]] * 23 + [[39]] * 2 + [[n] for n in range(13)]
    counts = [[1, 0, 0, 0]] * 25 + [[0, 1, 0, 0]] * 13
    order, _ = tuned_order(frames(*cells, counts=counts), np.array([[0.0, 1.0]]), SIZE)
    assert order[0] == 38
    assert {*order[1:13].tolist()} < {*range(13)}
    assert order[13] == 39


def test_a_count_weighs_by_its_share_of_a_full_scan_not_by_its_objects():
    """Ten objects kept and one that emerges: each count is worth as much."""
    counts = [[0, 0, 1, 0]] * 10 + [[1, 0, 0, 0]]
    given = frames(*[[n] for n in range(10)], [30], counts=counts)
    order, _ = tuned_order(given, HALVES, SIZE)
    assert order[0] == 30


@given(CELLS)
def test_the_first_cell_adds_most(cells):
    order, _ = tuned_order(frames(*cells), HALVES, SIZE)
    gains = [sum(0.5 for own in cells if cell in own) for cell in range(SIZE)]
    assert gains[order[0]] == max(gains)


@given(CELLS)
def test_two_cells_are_as_good_as_greedy_promises(cells):
    """A greedy choice of a submodular count has at least 1 - 1/e of the best."""

    def detected(chosen):
        hits = [len({*chosen} & own) for own in cells]
        return sum(HALVES[0, min(n, 3)] for n in hits)

    order, _ = tuned_order(frames(*cells), HALVES, SIZE)
    best = max(detected(pair) for pair in permutations(range(6), 2))
    assert detected(order[:2]) >= (1 - 1 / np.e) * best - 1e-9


def test_no_cell_comes_twice():
    order, _ = tuned_order(frames([1, 2], [2, 3]), HALVES, SIZE)
    assert len({*order.tolist()}) == len(order) == round(0.35 * SIZE)


def test_newcomers_of_a_film_count_as_such_in_their_first_keyframe_alone():
    film = handmade_film(4)
    made = frames_of(film)
    first = made.chances % 2 == 1
    assert (made.counts[:, :2].sum(axis=1) == first).all()
    assert made.counts[:, 2].all()
    cells = np.split(made.cells, np.cumsum(made.sizes)[:-1])
    found = sorted(own.tolist() for own, new in zip(cells, first, strict=True) if new)
    expected = [(WALKER, 1), (BESIDE, 2), (BEHIND, 2), (BUS, 2)]
    assert found == sorted(returns_of(*each).tolist() for each in expected)


def test_people_are_counted_as_people():
    made = frames_of(handmade_film(4))
    people = np.isin(made.chances // 2, [CLASSES.index("bicycle"), CLASSES.index("pedestrian")])
    assert people.any()
    assert (made.counts[:, 3] == people).all()


def test_a_newcomer_needs_more_returns_than_who_was_seen_before():
    table = chance_table()
    car = CLASSES.index("car")
    worth = measurement("centerpoint").recall.worth[car]
    assert table[2 * car, 0] == table[2 * car + 1, 0] == 0
    assert (table[2 * car, 1:40] > table[2 * car + 1, 1:40]).all()
    assert table[2 * car, 5] == pytest.approx(recall("centerpoint", "car", [5 * worth])[0])


def test_parts_are_joined():
    both = joined([frames([1, 2]), frames([3])])
    assert both.sizes.tolist() == [2, 1]
    assert both.cells.tolist() == [1, 2, 3]
