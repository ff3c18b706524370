"""Grids that do not go all round, that look elsewhere than ahead, whose rows are not equally
spaced, or whose LiDAR is tilted to the car: pitch raises its heading, roll lowers its right.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.order import SetMargins, reordered
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from tests.core.test_grid import sample

DEGREE = np.pi / 180
FORWARD = AngularGrid(120, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=120 * DEGREE)
"""Columns of a degree from -60 to 60, rows of five degrees."""
WIDE = AngularGrid(300, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=300 * DEGREE)
LEFT = AngularGrid(
    120, 5, 10 * DEGREE, -10 * DEGREE, field_of_view=120 * DEGREE, heading=150 * DEGREE
)
"""From 90 degrees over the seam to -150."""
LISTED = AngularGrid.of_elevations([8 * DEGREE, 2 * DEGREE, 0.0, -1 * DEGREE, -9 * DEGREE], 360)
SIZE = 360, 41, 40 * DEGREE, -40 * DEGREE
"""Columns of a degree, the middle of number 180 half a degree left of ahead; rows of two degrees,
number 20 on the level.
"""
LEVEL = AngularGrid(*SIZE)
RAISED = AngularGrid(*SIZE, pitch=10 * DEGREE)
LEANING = AngularGrid(*SIZE, roll=10 * DEGREE)
ASIDE = AngularGrid(*SIZE, heading=np.pi / 2, pitch=10 * DEGREE)
BOTH = AngularGrid(
    120,
    *SIZE[1:],
    field_of_view=120 * DEGREE,
    heading=0.7,
    pitch=-25 * DEGREE,
    roll=15 * DEGREE,
)
TILTED = pytest.mark.parametrize("grid", [RAISED, LEANING, ASIDE, BOTH])
TO_FRONT, TO_LEFT, TO_BACK, TO_RIGHT = (20 * 360 + column for column in (180, 270, 0, 90))
"""Cells of row 20, half a degree to the left of these directions."""
FORMS = [FORWARD, WIDE, LEFT, LISTED]
GRIDS = pytest.mark.parametrize("grid", [*FORMS, RAISED, LEANING, ASIDE, BOTH])


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


def test_a_hull_is_cut_at_the_edge_of_the_field_of_view():
    """A wall 10 m ahead from 0 to 40 m on the left spans 0 to 76 degrees, the grid ends at 60."""
    (hull,) = FORWARD.hulls([[10, 20, 0, 0.01, 40, 0.1, 0]], 0, 0)
    assert columns_of(FORWARD, hull) == list(range(59, 120))


def test_a_hull_behind_touches_both_ends_of_a_wide_grid():
    """A wall 10 m behind, 16 m wide, spans 38.7 degrees to either side of straight behind."""
    (hull,) = WIDE.hulls([[-10, 0, 0, 0.01, 16, 0.1, 0]], 0, 0)
    assert columns_of(WIDE, hull) == [*range(9), *range(291, 300)]


@pytest.mark.parametrize("grid", FORMS)
def test_a_box_around_the_sensor_covers_every_column(grid):
    (hull,) = grid.hulls([[0, 0, 0, 2, 2, 2, 0]], 0, 0)
    assert columns_of(grid, hull) == list(range(grid.columns))


@GRIDS
@given(
    st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-4, 4), st.floats(-4, 4)),
    st.integers(0, 99),
)
def test_a_hull_holds_every_cell_that_meets_its_box_once(grid, placed, seed):
    x, y, z, yaw = placed
    box = np.array([x, y, z, 4.0, 2.0, 1.5, yaw])
    cells = grid.cells_of(sample(box, seed))
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


def elevations_deg(grid, cells):
    return np.rad2deg(np.arcsin(grid.directions[cells, 2]))


@pytest.mark.parametrize(
    ("grid", "expected"),
    [(RAISED, [10, 0, -10, 0]), (LEANING, [0, 10, 0, -10])],
)
def test_pitch_raises_the_front_and_roll_lowers_the_right(grid, expected):
    assert elevations_deg(grid, [TO_FRONT, TO_LEFT, TO_BACK, TO_RIGHT]) == pytest.approx(
        expected, abs=0.1
    )


def test_pitch_raises_where_the_lidar_is_headed():
    """Column 180 looks along the heading, to the left, and column 90 ahead."""
    assert elevations_deg(ASIDE, [TO_FRONT, TO_RIGHT]) == pytest.approx([10, 0], abs=0.1)
    x, y, _ = ASIDE.directions[TO_FRONT]
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(90.5, abs=0.01)


def test_rows_are_told_as_they_lie_straight_ahead():
    assert np.rad2deg(RAISED.elevations_ahead[[0, 20, 25]]) == pytest.approx([50, 10, 0], abs=0.01)
    assert LEVEL.elevations_ahead is LEVEL.elevations


def test_the_hull_of_a_post_far_ahead_is_as_much_lower_as_the_lidar_looks_higher():
    """0.2 m wide and 2 m high, 60 m away: 0.2 degrees wide, and 1.9 degrees to either side."""
    post = [[60.0, 0.5, 0.0, 0.2, 0.2, 4.0, 0.0]]
    level, raised = (next(iter(grid.hulls(post, 0, 0))) // 360 for grid in (LEVEL, RAISED))
    assert sorted(set(level.tolist())) == [19, 20, 21]
    assert sorted(set(raised.tolist())) == [24, 25, 26]


@given(
    st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3, 3), st.floats(-4, 4)),
    st.integers(0, 99),
)
def test_without_a_tilt_worth_the_name_hulls_are_those_of_a_level_grid(placed, seed):
    """Told by corners and edges, the bounds of a box are those told by its footprint, but for the
    last bits: where these decide, a hull may differ by a row or a column.
    """
    nearly = AngularGrid(*SIZE, pitch=1e-13)
    size = np.random.default_rng(seed).uniform(0.3, 6, 3)
    box = np.array([[*placed[:3], *size, placed[3]]])
    for margin in (0, 1):
        (one,), (other,) = (grid.hulls(box, margin, margin) for grid in (LEVEL, nearly))
        narrower, wider = (grid.hulls(box, margin + 1, margin + 1) for grid in (LEVEL, nearly))
        assert {*one.tolist()} <= {*wider.cells.tolist()}
        assert {*other.tolist()} <= {*narrower.cells.tolist()}


def test_a_hull_is_no_larger_than_its_box_looks():
    """A post beside the car, seen by a LiDAR that leans to the other side: a column to either side
    of its middle, and the rows of its own height.
    """
    (hull,) = LEANING.hulls([[0.0, 20.0, 0.0, 0.5, 0.5, 1.0, 0.0]], 0, 0)
    assert sorted(set((hull % 360).tolist())) == [269, 270]
    # From 9 to 12 degrees below the LiDAR's own level, which to the left looks 10 degrees up.
    assert sorted(set((hull // 360).tolist())) == [24, 25, 26]


@TILTED
def test_a_box_around_the_axis_covers_every_column(grid):
    up = grid.tilt.as_matrix()[:, 2] * 1.3
    (hull,) = grid.hulls([[*up, 2, 2, 2, 0]], 0, 0)
    assert set((hull % grid.columns).tolist()) == set(range(grid.columns))
    assert 0 in hull


@TILTED
def test_the_wedge_of_a_box_in_a_picture_holds_the_cells_that_it_shows(grid):
    camera = PinholeCamera(yaw=0.6)
    box = np.array([[100.0, 60.0, 180.0, 140.0]])
    (wedge,) = grid.wedges(camera.box_rays(box))
    pixels, depths = camera.project(grid.directions)
    inside = (pixels >= box[0, :2]).all(axis=1) & (pixels <= box[0, 2:]).all(axis=1) & (depths > 0)
    shown = np.flatnonzero(inside)
    assert len(shown) > 50
    assert set(shown.tolist()) <= set(wedge.tolist())


@pytest.mark.parametrize("angle", ["pitch", "roll"])
@pytest.mark.parametrize("value", [0.79, -0.79, float("nan")])
def test_a_lidar_that_is_tilted_by_more_than_45_degrees_is_refused(angle, value):
    with pytest.raises(InvalidInput, match=f"{angle} of the grid must"):
        AngularGrid(**{angle: value})
