"""Grids that do not go all round, that look elsewhere than ahead, or whose rows are not equally
spaced.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.order import SetMargins, reordered
from care_sim.core.grid import AngularGrid

DEGREE = np.pi / 180
FORWARD = AngularGrid(120, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=120 * DEGREE)
"""Columns of a degree from -60 to 60, rows of five degrees."""
WIDE = AngularGrid(300, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=300 * DEGREE)
LEFT = AngularGrid(
    120, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=120 * DEGREE, heading=150 * DEGREE
)
"""From 90 degrees over the seam to -150."""
LISTED = AngularGrid.of_elevations([8 * DEGREE, 2 * DEGREE, 0.0, -1 * DEGREE, -9 * DEGREE], 360)
GRIDS = pytest.mark.parametrize("grid", [FORWARD, WIDE, LEFT, LISTED])


def towards(azimuth_deg, elevation_deg=0.0):
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    across = np.cos(elevation)
    return [across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)]


def columns_of(grid, cells):
    return sorted(set((cells % grid.columns).tolist()))


@GRIDS
def test_every_cell_is_the_cell_of_its_own_direction(grid):
    assert grid.cells_of(grid.directions).tolist() == list(range(grid.size))


def test_directions_beyond_the_field_of_view_fall_in_no_cell():
    azimuths = [-60.01, -59.99, 0.5, 59.99, 60.01, 180.0]
    found = FORWARD.cells_of([towards(azimuth) for azimuth in azimuths])
    assert found.tolist() == [-1, 240, 240 + 60, 240 + 119, -1, -1]


def test_a_heading_turns_the_columns_to_the_left():
    assert np.rad2deg(LEFT.azimuths[[0, 59, 60, 119]]) == pytest.approx(
        [90.5, 149.5, 150.5, -150.5]
    )
    assert (LEFT.cells_of([towards(0.0), towards(-179.5)]) % 120).tolist() == [119, 90]
    assert LEFT.cells_of([towards(0.0)]) == -1


def test_the_columns_nearest_to_straight_ahead():
    assert FORWARD.from_ahead[[0, 59, 60, 119]].tolist() == pytest.approx([59.5, 0.5, 0.5, 59.5])
    assert LEFT.from_ahead[[0, 89, 90, 119]] == pytest.approx([90.5, 179.5, 179.5, 150.5])


def test_listed_rows_take_what_is_nearest_to_them():
    elevations = [11.1, 10.9, 5.1, 4.9, 1.1, 0.9, -0.4, -0.6, -4.9, -5.1, -12.9, -13.1]
    cells = LISTED.cells_of([towards(0.5, elevation) for elevation in elevations])
    rows = np.where(cells < 0, -1, cells // 360)
    assert rows.tolist() == [-1, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, -1]
    assert LISTED.elevations.tolist() == list(LISTED.listed)


def test_equal_steps_listed_are_the_grid_of_equal_steps():
    plain = AngularGrid()
    listed = AngularGrid.of_elevations(plain.elevations.tolist())
    boxes = np.array([[10, 3, 0, 4, 2, 2, 0.3], [-9, 0, -1, 2, 8, 3, 1.0], [20, -9, 9, 1, 1, 1, 0]])
    for one, other in zip(plain.hulls(boxes), listed.hulls(boxes), strict=True):
        assert one.tolist() == other.tolist()


def test_a_hull_is_cut_at_the_edge_of_the_field_of_view():
    """A wall 10 m ahead from 0 to 40 m on the left spans 0 to 76 degrees, the grid ends at 60."""
    (hull,) = FORWARD.hulls([[10, 20, 0, 0.01, 40, 0.1, 0]], 0, 0)
    assert columns_of(FORWARD, hull) == list(range(59, 120))


def test_a_hull_behind_touches_both_ends_of_a_wide_grid():
    """A wall 10 m behind, 16 m wide, spans 38.7 degrees to either side of straight behind."""
    (hull,) = WIDE.hulls([[-10, 0, 0, 0.01, 16, 0.1, 0]], 0, 0)
    assert columns_of(WIDE, hull) == [*range(9), *range(291, 300)]


def test_a_hull_behind_misses_a_grid_that_looks_ahead():
    (hull,) = FORWARD.hulls([[-10, 0, 0, 2, 2, 2, 0]])
    assert len(hull) == 0


@GRIDS
def test_a_box_around_the_sensor_covers_every_column(grid):
    (hull,) = grid.hulls([[0, 0, 0, 2, 2, 2, 0]], 0, 0)
    assert columns_of(grid, hull) == list(range(grid.columns))


@GRIDS
@given(
    st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3, 3), st.floats(-4, 4)),
    st.integers(0, 99),
)
def test_a_hull_holds_every_cell_that_meets_its_box_once(grid, placed, seed):
    x, y, z, yaw = placed
    box = np.array([x, y, z, 4.0, 2.0, 1.5, yaw])
    half = np.random.default_rng(seed).uniform(-1, 1, (200, 3)) * box[3:6] / 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack(
        [cos * half[:, 0] - sin * half[:, 1], sin * half[:, 0] + cos * half[:, 1], half[:, 2]]
    )
    cells = grid.cells_of(turned + box[:3])
    (hull,) = grid.hulls([box], 0, 0)
    assert set(cells[cells >= 0].tolist()) <= set(hull.tolist())
    assert (np.diff(hull) > 0).all()


def test_cut_margins_at_the_edge_of_the_grid_are_core():
    """Columns 0 to 5 of all rows: only the left margin of two columns is known to be one."""
    cells = (np.arange(5)[:, None] * 120 + np.arange(6)).ravel()
    (found,) = reordered([cells], "core-spread", FORWARD, SetMargins(2, 0))
    assert set((found[: 4 * 5] % 120).tolist()) == {0, 1, 2, 3}


def test_a_set_at_both_ends_has_no_seam_to_run_over():
    cells = np.array([0, 1, 118, 119])
    (found,) = reordered([cells], "columns", FORWARD, SetMargins(0, 0))
    assert found.tolist() == [0, 1, 118, 119]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"columns": 100, "field_of_view": 100.3 * DEGREE}, "width that divides a whole turn"),
        ({"field_of_view": 0.0}, "field_of_view of the grid must lie in"),
        ({"heading": 4.0}, "heading of the grid must lie in"),
        ({"rows": 2, "listed": (0.1, 0.0)}, "must descend from its top"),
        ({"rows": 2, "listed": (0.1,)}, "elevations of its 2 rows"),
        ({"rows": 2, "top": 0.1, "bottom": 0.0, "listed": (0.1, "0")}, "must lie in"),
    ],
)
def test_wrong_grids_are_refused_in_one_line(wrong, said):
    with pytest.raises(InvalidInput, match=said) as refused:
        AngularGrid(**wrong)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("elevations", [[], [0.1], [0.0, 0.1], [0.1, 0.1], [0.1, float("nan")]])
def test_wrong_elevations_are_refused(elevations):
    with pytest.raises(InvalidInput, match=r"of the grid must"):
        AngularGrid.of_elevations(elevations)
