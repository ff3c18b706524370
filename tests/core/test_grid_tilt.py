"""Grids of a LiDAR that is tilted to the car: pitch raises its heading, roll lowers its right."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera

DEGREE = np.pi / 180
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
AHEAD, LEFT, BEHIND, RIGHT = (20 * 360 + column for column in (180, 270, 0, 90))
"""Cells of row 20, half a degree to the left of these directions."""


def elevations_deg(grid, cells):
    return np.rad2deg(np.arcsin(grid.directions[cells, 2]))


@pytest.mark.parametrize(
    ("grid", "expected"),
    [(RAISED, [10, 0, -10, 0]), (LEANING, [0, 10, 0, -10])],
)
def test_pitch_raises_the_front_and_roll_lowers_the_right(grid, expected):
    assert elevations_deg(grid, [AHEAD, LEFT, BEHIND, RIGHT]) == pytest.approx(expected, abs=0.1)


def test_pitch_raises_where_the_lidar_is_headed():
    """Column 180 looks along the heading, to the left, and column 90 ahead."""
    assert elevations_deg(ASIDE, [AHEAD, RIGHT]) == pytest.approx([10, 0], abs=0.1)
    x, y, _ = ASIDE.directions[AHEAD]
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(90.5, abs=0.01)


def test_rows_are_told_as_they_lie_straight_ahead():
    assert np.rad2deg(RAISED.elevations_ahead[[0, 20, 25]]) == pytest.approx([50, 10, 0], abs=0.01)
    assert LEVEL.elevations_ahead is LEVEL.elevations


@TILTED
def test_every_cell_is_the_cell_of_its_own_direction(grid):
    assert np.linalg.norm(grid.directions, axis=1) == pytest.approx(1)
    assert grid.cells_of(grid.directions).tolist() == list(range(grid.size))


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


@TILTED
@given(
    st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(-4, 4), st.floats(-4, 4)),
    st.integers(0, 99),
)
def test_a_hull_holds_every_cell_that_meets_its_box_once(grid, placed, seed):
    x, y, z, yaw = placed
    box = np.array([x, y, z, 4.0, 2.0, 1.5, yaw])
    half = np.random.default_rng(seed).uniform(-1, 1, (300, 3)) * box[3:6] / 2
    # Most extremes are on edges: points there are drawn, too.
    half[:200, :2] = np.sign(half[:200, :2]) * box[3:5] / 2
    half[100:200, 1:] = np.sign(half[100:200, 1:]) * box[4:6] / 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack(
        [cos * half[:, 0] - sin * half[:, 1], sin * half[:, 0] + cos * half[:, 1], half[:, 2]]
    )
    cells = grid.cells_of(turned + box[:3])
    (hull,) = grid.hulls([box], 0, 0)
    assert set(cells[cells >= 0].tolist()) <= set(hull.tolist())
    assert (np.diff(hull) > 0).all()


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
