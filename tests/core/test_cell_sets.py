"""Sets of cells in one array, held against lists of lists."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.sets import CellSets

groups = st.lists(st.lists(st.integers(0, 99), max_size=6), max_size=6)
places = st.integers(0, 8)


def listed(sets):
    return [cells.tolist() for cells in sets]


@given(groups)
def test_it_reads_as_the_sets_that_it_was_made_of(sets):
    made = CellSets.of(sets)
    assert listed(made) == sets
    assert len(made) == len(sets)
    assert [made[n].tolist() for n in range(len(sets))] == sets
    assert listed(made[1:3]) == sets[1:3]
    assert made.cells.tolist() == [cell for cells in sets for cell in cells]
    assert made.sizes.tolist() == [len(cells) for cells in sets]
    assert CellSets.of(made) is made


@given(st.lists(groups, max_size=4))
def test_groups_are_joined_in_their_order(some):
    joined = CellSets.joined([CellSets.of(sets) for sets in some])
    assert listed(joined) == [cells for sets in some for cells in sets]


@given(groups, places, places)
def test_a_part_is_the_same_slice_of_every_set(sets, first, more):
    part = CellSets.of(sets).part(first, first + more)
    assert listed(part) == [cells[first : first + more] for cells in sets]


@given(groups, st.data())
def test_some_sets_are_taken_by_mask_or_by_number(sets, data):
    made = CellSets.of(sets)
    mask = data.draw(st.lists(st.booleans(), min_size=len(sets), max_size=len(sets)))
    kept = [cells for cells, keep in zip(sets, mask, strict=True) if keep]
    assert listed(made.take(np.array(mask, bool))) == kept
    if sets:
        numbers = data.draw(st.lists(st.integers(0, len(sets) - 1), max_size=9))
        taken = made.take(np.array(numbers, np.int64))
        assert listed(taken) == [sets[number] for number in numbers]


def test_cells_of_any_whole_type_become_one():
    made = CellSets.of([np.array([3, 5], np.uint8), [], range(2), np.array([], float)])
    assert made.cells.dtype == np.int64
    assert listed(made) == [[3, 5], [], [0, 1], []]


@pytest.mark.parametrize("cells", [[0.5], [[1]], "ab", np.ones(4, bool), 7])
def test_what_is_no_list_of_indices_is_refused(cells):
    with pytest.raises(InvalidInput, match="a set of cells must be a list of cell indices"):
        CellSets.of([[1, 2], cells])
