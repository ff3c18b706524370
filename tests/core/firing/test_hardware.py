"""Rules that all hardware keeps, and the cells that each fires of demands made by hand."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.base.errors import InvalidInput
from care_sim.core.firing.actions import scores_of
from care_sim.core.firing.base import demanded, ranked
from care_sim.core.firing.listing import hardware_of, settled
from care_sim.core.grid import AngularGrid
from tests.helpers.floors import drawn_floors, floor_order

GRID = AngularGrid(columns=12, rows=6)
NOTHING = np.empty(0, np.int64)
ALL = (
    "cells",
    "tiles:2x3",
    "tiles:1x1",
    "segments:4",
    "rows",
    "columns",
    "vertical-window",
    "azimuth-window:60",
    "azimuth-window:0",
    "azimuth-window:180",
    "energy:1",
    "energy:4",
)
BLOCKS = tuple(name for name in ALL if "window" not in name and "energy" not in name)
demands = st.lists(st.integers(0, GRID.size - 1), unique=True).map(lambda c: np.array(c, np.int64))
shares = st.integers(0, 12).map(lambda twelfths: twelfths / 12)


def at(*places, grid=GRID):
    """The cells at (row, column)."""
    return np.array([row * grid.columns + column for row, column in places], np.int64)


def fired(name, demand, units, floor=None, last=NOTHING, grid=GRID):
    """The cells that the hardware fires of a demand in order, with a budget of so many units."""
    hardware = hardware_of(name, grid)
    return hardware.fire(
        scores_of(demand, grid.shape), units * hardware.unit_cells, floor, last
    ).tolist()


def columns_of(cells, grid=GRID):
    return sorted({cell % grid.columns for cell in cells})


def rows_of(cells, grid=GRID):
    return sorted({cell // grid.columns for cell in cells})


@given(name=st.sampled_from(ALL), demand=demands, floor=drawn_floors, share=shares, last=demands)
def test_it_fires_whole_units_ascending_and_never_above_its_budget(
    name, demand, floor, share, last
):
    hardware = hardware_of(name, GRID)
    units = round(share * hardware.units)
    before = fired(name, last, units)
    for spent in (None, floor):
        cells = fired(name, demand, units, spent, np.array(before, np.int64))
        assert cells == sorted(cells)
        shots = np.bincount(np.array(cells, np.int64), minlength=GRID.size)
        assert shots.max() <= hardware.most_shots
        sizes = np.bincount(hardware.unit_of[shots > 0], minlength=hardware.units)
        assert {*sizes.tolist()} <= {0, hardware.unit_cells}
        assert len(cells) <= units * hardware.unit_cells
    # With a floor nothing stays unspent.
    assert len(cells) == units * hardware.unit_cells


@given(demand=demands, floor=st.none() | drawn_floors, budget=st.integers(0, GRID.size))
def test_a_unit_of_one_cell_is_a_free_cell(demand, floor, budget):
    free = fired("cells", demand, budget, floor)
    assert fired("tiles:1x1", demand, budget, floor) == free
    assert fired("segments:1", demand, budget, floor) == free


@given(name=st.sampled_from(BLOCKS), demand=demands, floor=drawn_floors, share=shares)
def test_units_are_taken_in_the_order_of_the_demand_and_then_of_the_floor(
    name, demand, floor, share
):
    hardware = hardware_of(name, GRID)
    units = round(share * hardware.units)
    cells = np.concatenate([demand, floor_order(floor, GRID.size)])
    order = [*dict.fromkeys(hardware.unit_of[cells].tolist())]
    found = hardware.unit_of[fired(name, demand, units, floor)]
    assert {*found.tolist()} == {*order[:units]}


@given(
    name=st.sampled_from(["vertical-window", "azimuth-window:180"]), demand=demands, share=shares
)
def test_a_window_that_may_go_anywhere_serves_the_first_cell(name, demand, share):
    units = round(share * hardware_of(name, GRID).units)
    assume(units > 0 and len(demand))
    assert demand[0] in fired(name, demand, units)


@given(
    arrays(
        np.float32,
        (4, 9),
        elements=st.sampled_from([0.0, -0.0, -1.0, 1e-45, 1e-30, 0.25, 0.5, 1.0, np.inf]),
    )
)
def test_the_order_of_a_demand_is_that_of_its_scores(scores):
    assert demanded(scores).tolist() == ranked(scores).tolist()


def test_blocks_by_hand():
    """The first two cells share one of the tiles of 2 x 3, and the fourth comes too late."""
    demand = at((0, 1), (1, 2), (5, 11), (3, 3))
    tile = [*range(3), *range(12, 15)]
    last_tile = [cell for row in (4, 5) for cell in range(row * 12 + 9, row * 12 + 12)]
    assert fired("tiles:2x3", demand, 2) == sorted(tile + last_tile)
    assert fired("segments:4", demand, 2) == [0, 1, 2, 3, *range(12, 16)]
    assert rows_of(fired("rows", demand, 2)) == [0, 1]
    assert columns_of(fired("columns", demand, 3)) == [1, 2, 11]


def test_a_vertical_window_by_hand():
    """Three of six rows: 1 and 3 fit, 4 would lose row 1, 2 is there anyway."""
    assert rows_of(fired("vertical-window", at((1, 0), (4, 5), (3, 2), (2, 2)), 3)) == [1, 2, 3]
    # It moves no further than it must, and stays without a demand.
    low = np.array(fired("vertical-window", at((5, 0)), 3), np.int64)
    assert rows_of(low) == [3, 4, 5]
    assert rows_of(fired("vertical-window", at((1, 0)), 3, last=low)) == [1, 2, 3]
    assert fired("vertical-window", NOTHING, 3, last=low) == low.tolist()


def test_a_vertical_window_begins_on_the_horizon():
    grid = AngularGrid()
    middle = np.rad2deg(
        grid.elevations[rows_of(fired("vertical-window", NOTHING, 1, grid=grid), grid)]
    )
    assert abs(middle[0]) <= np.rad2deg(grid.row_height) / 2


def test_an_azimuth_window_begins_straight_ahead():
    assert columns_of(fired("azimuth-window:0", at((0, 0)), 4)) == [4, 5, 6, 7]


def test_an_azimuth_window_turns_over_the_seam_and_by_no_more_than_it_may():
    """60 degrees are two of twelve columns. From 9, 10, 11 it comes as far as 11, 0, 1."""
    last = at(*((row, column) for row in range(6) for column in (9, 10, 11)))
    assert columns_of(fired("azimuth-window:60", at((2, 1)), 3, last=last)) == [0, 1, 11]
    assert columns_of(fired("azimuth-window:60", at((2, 2), (2, 0)), 3, last=last)) == [0, 10, 11]
    assert columns_of(fired("azimuth-window:59", at((2, 1)), 3, last=last)) == [9, 10, 11]
    assert columns_of(fired("azimuth-window:180", at((2, 5)), 3, last=last)) == [5, 6, 7]


@given(demand=demands, last=demands, width=st.integers(1, 11), turn=st.integers(0, 11))
def test_the_seam_makes_no_difference(demand, last, width, turn):
    """Demand and window turned by some columns fire the same, turned as much."""

    def turned(cells):
        cells = np.array(cells, np.int64)
        return cells // 12 * 12 + (cells % 12 + turn) % 12

    stood = np.array(fired("azimuth-window:180", last, width), np.int64)
    expected = turned(fired("azimuth-window:60", demand, width, last=stood))
    found = fired("azimuth-window:60", turned(demand), width, last=turned(stood))
    assert found == sorted(expected.tolist())


@given(
    name=st.sampled_from(ALL),
    worth=st.lists(st.integers(0, 5), min_size=72, max_size=72),
    share=shares,
    last=demands,
)
def test_the_best_units_can_fire_together_and_no_others_are_worth_more(name, worth, share, last):
    """Every choice that the hardware can fire, one by one, is worth no more."""
    hardware = hardware_of(name, GRID)
    worth = np.array(worth[: hardware.units])
    units = round(share * hardware.units)
    stood = np.array(fired(name, last, units), np.int64)
    best = hardware.best(worth, units * hardware.unit_cells, stood).tolist()
    assert worth[best].tolist() == sorted(worth[best].tolist(), reverse=True)
    cells = np.flatnonzero(np.isin(hardware.unit_of, best))
    assert {*cells.tolist()} <= {*fired(name, cells, units, last=stood)}
    assert worth[best].all()
    if "window" not in name:
        assert worth[best].sum() == np.sort(worth)[::-1][:units].sum()
    else:
        everywhere = [
            fired(name, np.flatnonzero(hardware.unit_of == unit), units, last=stood)
            for unit in range(hardware.units)
        ]
        rivals = (np.unique(hardware.unit_of[each]) for each in everywhere)
        assert worth[best].sum() >= max(worth[rival].sum() for rival in rivals)


def test_every_fired_cell_is_credited_to_the_first_that_its_unit_was_demanded_for():
    hardware = hardware_of("segments:4", GRID)
    found = hardware.credited(at((0, 2), (1, 0), (0, 1)), at((0, 0), (0, 3), (1, 1), (2, 0)))
    assert found.tolist() == [0, 0, 1, 3]


def test_the_budget_is_rounded_in_units():
    assert hardware_of("rows", AngularGrid()).budget_cells(0.03) == 512
    assert hardware_of("tiles", AngularGrid()).budget_cells(0.03) == 15 * 32
    assert hardware_of("cells", AngularGrid()).budget_cells(0.03) == 492
    with pytest.raises(InvalidInput, match=r"budget 0.01 leaves no row of 32; 0.031 is one"):
        hardware_of("rows", AngularGrid()).budget_cells(0.01)


def test_texts_that_mean_the_same_are_equal():
    assert settled("tiles") == "tiles:4x8"
    assert settled("azimuth-window:10.0") == settled("azimuth-window") == "azimuth-window:10"
    assert settled("cells") == "cells"


@pytest.mark.parametrize(
    "text", ["", "magic", "cells:", "tiles:4", "tiles:4.5x8", "tiles:-4x8", "rows:2", "segments:x",
             "azimuth-window:nan", "tiles:4x8x2", "azimuth-window:" + "9" * 40, None, 3]
)  # fmt: skip
def test_another_text_is_refused_in_one_line(text):
    with pytest.raises(InvalidInput, match=r"known: cells, tiles:ROWSxCOLUMNS, ") as refused:
        settled(text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("tiles:5x8", "rows of firing tiles must divide the 32 of the grid, got 5"),
        ("tiles:4x0", "columns of firing tiles must divide the 512 of the grid, got 0"),
        ("segments:1000", "columns of firing segments must divide the 512 of the grid, got 1000"),
        ("azimuth-window:181", r"degrees of firing azimuth-window must lie in \[0, 180\]"),
    ],
)
def test_units_must_fit_the_grid(text, named):
    with pytest.raises(InvalidInput, match=named):
        hardware_of(text, AngularGrid())


def test_an_azimuth_window_is_of_a_grid_that_goes_all_round_and_begins_straight_ahead():
    forward = AngularGrid(columns=60, field_of_view=np.deg2rad(120))
    with pytest.raises(InvalidInput, match="turns all round, and the grid has no more than 120"):
        hardware_of("azimuth-window:0", forward)

    turned = AngularGrid(columns=36, heading=np.deg2rad(90))
    columns = columns_of(fired("azimuth-window:0", np.arange(turned.size), 2, grid=turned), turned)
    assert sorted(np.rad2deg(turned.azimuths[columns]).round()) == [-5, 5]
