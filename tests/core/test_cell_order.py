"""The order of the cells inside a set."""

import re

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.cells.order import COLUMN_STEP, ROW_STEP, SetMargins, reordered
from care_sim.core.defaults import AS_DEMANDED, CELL_ORDERS
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Demand

GRID = AngularGrid()
COLUMNS, ROWS = GRID.columns, GRID.rows
MARGINS = SetMargins(2, 1)
ORDERS = CELL_ORDERS[1:]


def rectangle(first, width, upper, height):
    """The ascending cells of `width` columns from `first` on, over the seam, and of some rows."""
    columns = (first + np.arange(width)) % COLUMNS
    rows = np.arange(upper, upper + height)
    return np.sort((rows[:, None] * COLUMNS + columns).ravel())


def listed(cells, order, margins=MARGINS):
    (found,) = reordered([cells], order, GRID, margins)
    return found


def places(cells, first):
    """Rows, and columns counted from `first`."""
    return cells // COLUMNS, (cells % COLUMNS - first) % COLUMNS


@st.composite
def rectangles(draw):
    width = draw(st.integers(1, COLUMNS))
    height = draw(st.integers(1, ROWS))
    return draw(st.integers(0, COLUMNS - 1)), width, draw(st.integers(0, ROWS - height)), height


@given(st.lists(st.integers(0, GRID.size - 1), unique=True), st.sampled_from(ORDERS))
def test_every_order_lists_the_cells_of_the_set(cells, order):
    assert np.sort(listed(np.array(cells, np.int64), order)).tolist() == sorted(cells)


@given(
    st.lists(rectangles(), max_size=4),
    st.integers(0, 50) | st.integers(0, 2 * GRID.size),
    st.sampled_from(ORDERS),
)
def test_the_first_few_cells_are_those_of_the_whole_order(where, most, order):
    sets = [rectangle(*each) for each in where]
    whole = reordered(sets, order, GRID, MARGINS)
    first = reordered(sets, order, GRID, MARGINS, most)
    assert [cells.tolist() for cells in first] == [cells[:most].tolist() for cells in whole]


@given(rectangles())
def test_rows_and_columns(where):
    first, width, _, _ = where
    cells = rectangle(*where)
    assert listed(cells[::-1], "rows-down").tolist() == cells.tolist()
    rows, columns = places(listed(cells, "rows-up"), 0)
    assert np.lexsort((columns, -rows)).tolist() == [*range(len(cells))]
    start = first if width < COLUMNS else 0
    rows, columns = places(listed(cells, "columns"), start)
    assert np.lexsort((rows, columns)).tolist() == [*range(len(cells))]


@given(
    rectangles(), st.integers(0, COLUMNS - 1), st.sampled_from(["columns", "spread", "core-spread"])
)
def test_the_seam_makes_no_difference(where, turned, order):
    first, width, upper, height = where
    if width == COLUMNS:
        return
    here = places(listed(rectangle(*where), order), first)
    there = (first + turned) % COLUMNS
    turned_cells = listed(rectangle(there, width, upper, height), order)
    assert np.array_equal(here, places(turned_cells, there))


@given(rectangles(), st.integers(0, 3), st.integers(0, 3))
def test_the_core_is_the_rectangle_before_it_was_dilated(where, sides, ends):
    first, width, upper, height = where
    whole = rectangle(
        first - sides,
        min(width + 2 * sides, COLUMNS),
        max(upper - ends, 0),
        min(upper + height + ends, ROWS) - max(upper - ends, 0),
    )
    found = listed(whole, "core-spread", SetMargins(sides, ends))
    core = rectangle(*where)
    # All round, and where the grid cuts the margins, more is core: `by_the_letter` holds that.
    assume(width + 2 * sides < COLUMNS)
    assume(upper - ends > 0 and upper + height + ends < ROWS)
    assert set(found[: len(core)]) == set(core)
    # Core and rim are each in the order of the whole.
    spread = listed(whole, "spread")
    in_core = np.isin(spread, core)
    assert np.array_equal(found, np.concatenate([spread[in_core], spread[~in_core]]))


def test_a_set_that_is_all_margin_keeps_its_middle():
    cells = rectangle(10, 3, 5, 2)
    found = listed(cells, "core-spread", SetMargins(2, 1))
    rows, columns = places(found, 10)
    assert columns[:2].tolist() == [1, 1]
    assert sorted(rows[:2]) == [5, 6]


def test_rows_cut_by_the_grid_have_no_margin():
    rows, _ = places(listed(rectangle(100, 5, 0, 4), "core-spread"), 100)
    assert sorted(rows[:3]) == [0, 1, 2]


@pytest.mark.parametrize("order", ["spread", "core-spread"])
@pytest.mark.parametrize(("width", "height"), [(12, 8), (20, 4), (40, 10), (7, 7)])
def test_any_first_few_cells_lie_evenly(order, width, height):
    """In every window the share of the cells taken departs from that of all by less than four
    cells; eight random orders depart by more.
    """
    cells = rectangle(200, width, 10, height)

    def unevenness(found):
        rows, columns = places(found, 200)
        worst = 0.0
        for count in range(1, len(found)):
            taken = np.zeros((height, width))
            taken[rows[:count] - 10, columns[:count]] = 1
            below = np.pad(taken.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
            area = np.outer(np.arange(height + 1), np.arange(width + 1)) * count / len(found)
            worst = max(worst, np.abs(below - area).max())
        return worst

    margins = MARGINS if order == "spread" else SetMargins(0, 0)
    ours = unevenness(listed(cells, order, margins))
    others = [unevenness(np.random.default_rng(seed).permutation(cells)) for seed in range(8)]
    assert ours < 4
    assert ours < min(others)


def test_random_is_one_permutation_of_the_grid():
    everything = listed(np.arange(GRID.size), "random")
    some = rectangle(500, 30, 3, 9)
    assert listed(some, "random").tolist() == [c for c in everything.tolist() if c in set(some)]
    assert not np.array_equal(everything, np.sort(everything))


def test_sets_are_ordered_one_by_one():
    sets = [rectangle(5, 9, 2, 4), np.empty(0, np.int64), rectangle(500, 30, 20, 12)]
    for order in ORDERS:
        together = reordered(sets, order, GRID, MARGINS)
        assert [a.tolist() for a in together] == [
            listed(cells, order).tolist() if len(cells) else [] for cells in sets
        ]


@pytest.mark.parametrize("cell", [-1, GRID.size])
def test_a_cell_beyond_the_grid_is_refused(cell):
    with pytest.raises(InvalidInput, match="cells must lie in"):
        reordered([np.array([0, cell])], "spread", GRID, MARGINS)


def test_the_rig_lists_all_sets_of_a_demand():
    demand = Demand([rectangle(5, 9, 2, 4)], [[rectangle(30, 9, 2, 4)], [rectangle(60, 5, 2, 4)]])
    assert Rig().in_cell_order(demand) is demand
    spread = Rig(cell_order="spread").in_cell_order(demand)
    for ours, theirs in zip(
        [*spread.exploitation, *spread.layers[0], *spread.layers[1]],
        [*demand.exploitation, *demand.layers[0], *demand.layers[1]],
        strict=True,
    ):
        assert np.array_equal(ours, listed(theirs, "spread"))


def test_the_allocator_takes_a_set_in_its_order():
    assert allocate(Demand(layers=[[[7, 3, 5], [5, 1]]]), 4, 0.3).tolist() == [7, 5, 3, 1]


@st.composite
def grids_and_sets(draw):
    """Small, wide and high grids; sets of any form, at the seam, empty, rectangular."""
    grid = AngularGrid(*draw(st.sampled_from([(1, 2), (8, 4), (31, 3), (512, 32), (1024, 64)])))
    random = draw(st.randoms(use_true_random=False))
    sets = []
    for form in draw(st.lists(st.sampled_from(["any", "seam", "rectangle"]), max_size=4)):
        size = random.randrange(min(grid.size, 60))
        cells = random.sample(range(grid.size), size)
        if form == "seam":
            cells = [0, grid.columns - 1, grid.size - 1][: 1 + size % 3]
        elif form == "rectangle":
            width = random.randrange(1, min(grid.columns, 40) + 1)
            height = random.randrange(1, min(grid.rows, 12) + 1)
            first, upper = random.randrange(grid.columns), random.randrange(grid.rows - height + 1)
            cells = [
                row * grid.columns + (first + n) % grid.columns
                for row in range(upper, upper + height)
                for n in range(width)
            ]
        sets.append(np.array(sorted({*cells}), np.int64))
    return grid, sets, SetMargins(draw(st.integers(0, 4)), draw(st.integers(0, 3)))


def by_the_letter(cells, order, grid, margins):
    """The documented order once more, cell by cell, with sorted tuples."""
    columns = {c % grid.columns for c in cells}
    first = min(columns)
    if {0, grid.columns - 1} <= columns:
        runs = "".join("x" if n in columns else "." for n in range(grid.columns))
        gaps = [(len(gap), -start) for gap, start in free_runs(runs)]
        first = -max(gaps)[1] + max(gaps)[0] if gaps else 0
    width = max((c % grid.columns - first) % grid.columns for c in cells) + 1
    rows = [c // grid.columns for c in cells]
    side = 0 if width == grid.columns else min(margins.columns, (width - 1) // 2)
    ends = min(margins.rows, (max(rows) - min(rows)) // 2)

    def key(cell):
        row, column = divmod(cell, grid.columns)
        place = (column - first) % grid.columns
        number = (place * COLUMN_STEP + (row - min(rows)) * ROW_STEP) % 2**32
        in_core = (
            side <= place < width - side
            and (min(rows) == 0 or row >= min(rows) + ends)
            and (max(rows) == grid.rows - 1 or row <= max(rows) - ends)
        )
        return {
            "rows-down": (cell,),
            "rows-up": (-row, column),
            "columns": (place, row),
            "spread": (number,),
            "core-spread": (not in_core, number),
        }[order]

    return sorted(cells, key=key)


def free_runs(runs):
    """The stretches of dots, each with its start."""
    return [(found.group(), found.start()) for found in re.finditer(r"\.+", runs)]


@given(grids_and_sets(), st.sampled_from([name for name in ORDERS if name != "random"]))
def test_agrees_with_the_orders_by_the_letter(made, order):
    grid, sets, margins = made
    for ours, cells in zip(reordered(sets, order, grid, margins), sets, strict=True):
        expected = by_the_letter(cells.tolist(), order, grid, margins) if len(cells) else []
        assert ours.tolist() == expected


@pytest.mark.parametrize("order", [AS_DEMANDED, "backwards", None])
def test_only_an_order_can_be_asked_for(order):
    with pytest.raises(InvalidInput, match=r"unknown order .*; known: columns, core-spread"):
        reordered([np.arange(9)], order, GRID, MARGINS)


@pytest.mark.parametrize("demand", [None, Demand(None), Demand((), None), Demand((), [None])])
def test_a_demand_of_another_form_is_refused_as_the_allocator_does(demand):
    with pytest.raises(InvalidInput) as ours:
        Rig(cell_order="spread").in_cell_order(demand)
    with pytest.raises(InvalidInput) as theirs:
        allocate(demand, 5, 0.3)
    assert str(ours.value) == str(theirs.value)


def test_an_unknown_order_is_named():
    with pytest.raises(InvalidInput, match="cell_order 'backwards'; known: as-demanded"):
        Rig(cell_order="backwards")
    assert Rig().cell_order == AS_DEMANDED
