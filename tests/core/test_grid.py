import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera

GRID = AngularGrid()
DEGREE = np.pi / 180

boxes = st.tuples(
    st.floats(-40, 40),
    st.floats(-40, 40),
    st.floats(-6, 6),
    st.floats(0.1, 15),
    st.floats(0.1, 15),
    st.floats(0.1, 8),
    st.floats(-4, 4),
).map(np.array)


def rows_and_columns(cells):
    return sorted(set((cells // GRID.columns).tolist())), sorted(
        set((cells % GRID.columns).tolist())
    )


def rectangle(rows, columns):
    return [row * GRID.columns + column for row in rows for column in sorted(columns)]


def towards(azimuth, elevation=0.0):
    return [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]


def points_in(box, shares):
    """Points of a box, `shares` (n, 3) in (-1, 1) being their place along its half extents."""
    local = shares * box[3:6] / 2
    cos, sin = np.cos(box[6]), np.sin(box[6])
    x, y = cos * local[:, 0] - sin * local[:, 1], sin * local[:, 0] + cos * local[:, 1]
    return box[:3] + np.stack([x, y, local[:, 2]], axis=-1)


def sample(box, seed, count=400):
    shares = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    shares[: count // 2] = np.sign(shares[: count // 2]) * np.abs(shares[: count // 2]) ** 0.02
    return points_in(box, shares * (1 - 1e-9))


def footprint_holds_sensor(box):
    cos, sin = np.cos(box[6]), np.sin(box[6])
    x, y = -cos * box[0] - sin * box[1], sin * box[0] - cos * box[1]
    return abs(x) <= box[3] / 2 and abs(y) <= box[4] / 2


def test_the_default_grid_is_the_papers():
    assert GRID.shape == (32, 512)
    assert GRID.size == 16384
    assert GRID.row_height == pytest.approx(1.3335 * DEGREE, abs=1e-4 * DEGREE)


@pytest.mark.parametrize(
    "tested", [GRID, AngularGrid(columns=7, rows=3), AngularGrid(columns=360, rows=64)]
)
def test_every_cell_is_the_cell_of_its_own_direction(tested):
    assert tested.cells_of(tested.directions).tolist() == list(range(tested.size))
    assert np.allclose(np.linalg.norm(tested.directions, axis=1), 1.0)


def test_columns_and_rows_run_as_the_contract_says():
    first, forward, last = (GRID.directions[column] for column in (0, 256, 511))
    assert np.arctan2(first[1], first[0]) == pytest.approx(-np.pi + np.pi / 512)
    assert np.arctan2(forward[1], forward[0]) == pytest.approx(np.pi / 512)
    assert np.arctan2(last[1], last[0]) == pytest.approx(np.pi - np.pi / 512)
    assert np.arcsin(GRID.directions[0][2]) == pytest.approx(10.67 * DEGREE)
    assert np.arcsin(GRID.directions[-1][2]) == pytest.approx(-30.67 * DEGREE)


def test_a_column_holds_its_right_limit_and_not_its_left():
    width = 2 * np.pi / 512
    for column in (0, 1, 255, 256, 257, 511):
        right = -np.pi + column * width
        row = GRID.cells_of([towards(right + 1e-12), towards(right + width - 1e-9)]) % 512
        assert row.tolist() == [column, column]
    assert GRID.cells_of([towards(0.0)])[0] % 512 == 256


def test_both_ends_of_the_seam_fall_in_a_column():
    plus, minus, behind = (
        GRID.cells_of([towards(np.pi - 1e-9), towards(-np.pi + 1e-9), [-1.0, -0.0, 0.0]]) % 512
    )
    assert (plus, minus, behind) == (511, 0, 0)
    assert GRID.cells_of([[-1.0, 0.0, 0.0]])[0] % 512 == 0


def test_rows_reach_half_a_row_beyond_the_outer_rings():
    half = GRID.row_height / 2
    above, top, bottom, below = GRID.cells_of(
        [
            towards(0.1, GRID.top + half + 1e-6),
            towards(0.1, GRID.top + half - 1e-6),
            towards(0.1, GRID.bottom - half + 1e-6),
            towards(0.1, GRID.bottom - half - 1e-6),
        ]
    )
    assert above == below == -1
    assert top // 512 == 0
    assert bottom // 512 == 31


def test_hull_worked_by_hand():
    """A 2 m cube 10 m ahead: its near face spans +-6.34 degrees both ways."""
    (hull,) = GRID.hulls([[10, 0, 0, 2, 2, 2, 0]], 0, 0)
    assert hull.tolist() == rectangle(range(3, 14), range(246, 266))


def test_hull_of_a_box_below_the_horizon_uses_its_far_edge_for_the_top():
    """From z -3 to -1, between 9 m and 11 m: from -18.4 to -5.2 degrees."""
    (hull,) = GRID.hulls([[10, 0, -2, 2, 2, 2, 0]], 0, 0)
    rows, _ = rows_and_columns(hull)
    highest = np.arctan2(-1, np.hypot(11, 1))
    lowest = np.arctan2(-3, 9)
    expected = [int((10.67 * DEGREE - e) / GRID.row_height + 0.5) for e in (highest, lowest)]
    assert [rows[0], rows[-1]] == expected


@given(boxes, st.integers(0, 2**32 - 1))
def test_every_direction_that_meets_a_box_is_in_its_hull(box, seed):
    (hull,) = GRID.hulls([box], 0, 0)
    cells = GRID.cells_of(sample(box, seed))
    assert set(cells[cells >= 0].tolist()) <= set(hull.tolist())


@given(boxes)
def test_a_hull_reaches_no_further_than_the_corners(box):
    assume(not footprint_holds_sensor(box))
    (hull,) = GRID.hulls([box], 0, 0)
    assume(len(hull))
    columns = set((hull % 512).tolist())
    corners = points_in(box, np.array([[x, y, 0.0] for x in (1, -1) for y in (1, -1)]))
    reached = set(
        np.floor((np.arctan2(corners[:, 1], corners[:, 0]) + np.pi) / GRID.column_width).astype(int)
        % 512
    )
    ends = {c for c in columns if (c - 1) % 512 not in columns or (c + 1) % 512 not in columns}
    assert ends <= reached
    assert len(ends) in (1, 2)


@given(boxes, st.integers(0, 3), st.integers(0, 2))
def test_margins_dilate_by_exactly_their_columns_and_rows(box, azimuth_margin, elevation_margin):
    (bare,) = GRID.hulls([box], 0, 0)
    assume(len(bare))
    (hull,) = GRID.hulls([box], azimuth_margin, elevation_margin)
    rows, columns = bare // 512, bare % 512
    grown = {
        (row + up) * 512 + (column + side) % 512
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
        for up in range(-elevation_margin, elevation_margin + 1)
        for side in range(-azimuth_margin, azimuth_margin + 1)
        if 0 <= row + up < 32
    }
    assert set(hull.tolist()) == grown


def test_margins_can_differ_from_box_to_box():
    same = [15, 0, -1, 2, 2, 2, 0]
    hulls = GRID.hulls([same, same, same], np.array([0, 1, 2]))
    widths = [len(rows_and_columns(hull)[1]) for hull in hulls]
    assert widths == [widths[0], widths[0] + 2, widths[0] + 4]
    assert len({len(rows_and_columns(hull)[0]) for hull in hulls}) == 1


def test_a_box_across_the_seam_covers_both_ends_and_nothing_between():
    (hull,) = GRID.hulls([[-10, 0, 0, 2, 2, 2, 0]], 0, 0)
    _, columns = rows_and_columns(hull)
    assert columns == [*range(10), *range(502, 512)]


@pytest.mark.parametrize("x", [0.0, 1.9])
def test_a_box_that_surrounds_the_sensor_covers_every_column(x):
    (hull,) = GRID.hulls([[x, 0, 0, 4, 2, 2, 0]])
    assert hull.tolist() == list(range(GRID.size))


@pytest.mark.parametrize("z", [30.0, -30.0])
def test_a_box_outside_the_field_of_view_has_an_empty_hull(z):
    (hull,) = GRID.hulls([[10, 0, z, 2, 2, 2, 0]])
    assert hull.tolist() == []


def test_no_boxes_no_hulls():
    assert len(GRID.hulls(np.empty((0, 7)))) == 0
    assert len(GRID.wedges(np.empty((0, 9, 3)))) == 0


cameras = st.builds(
    PinholeCamera,
    yaw=st.floats(-np.pi, np.pi),
    pitch=st.floats(-0.4, 0.4),
    horizontal_fov=st.floats(0.6, 2.0),
)
image_boxes = st.tuples(
    st.integers(0, 318), st.integers(0, 178), st.integers(1, 320), st.integers(1, 180)
).map(lambda b: (b[0], b[1], min(b[0] + b[2], 320), min(b[1] + b[3], 180)))


@given(cameras, image_boxes)
def test_a_wedge_covers_the_ray_of_every_pixel_of_its_box(camera, box):
    assert_wedge_covers_box(camera, box)


def assert_wedge_covers_box(camera, box):
    left, top, right, bottom = box
    u, v = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    cells = GRID.cells_of(camera.rays(np.stack([u.ravel(), v.ravel()], axis=-1)))
    (wedge,) = GRID.wedges(camera.box_rays([box]), 0, 0)
    assert set(cells[cells >= 0].tolist()) <= set(wedge.tolist())
    assert wedge.tolist() == np.unique(wedge).tolist()


def test_wedge_worked_by_hand():
    """The right half of a level 90-degree picture, around the horizon: azimuths -45 to 0."""
    camera = PinholeCamera()
    (wedge,) = GRID.wedges(camera.box_rays([[160, 80, 320, 100]]), 0, 0)
    rows, columns = rows_and_columns(wedge)
    assert columns == list(range(192, 257))
    highest = np.arctan2(10 / 160, 1)
    expected = [int((10.67 * DEGREE - e) / GRID.row_height + 0.5) for e in (highest, -highest)]
    assert [rows[0], rows[-1]] == expected


def test_wedges_have_the_margins_of_hulls():
    rays = PinholeCamera(yaw=np.pi).box_rays([[150, 80, 170, 100]])
    (bare,), (wedge,) = GRID.wedges(rays, 0, 0), GRID.wedges(rays)
    (bare_rows, bare_columns), (rows, columns) = rows_and_columns(bare), rows_and_columns(wedge)
    assert len(columns) == len(bare_columns) + 4
    assert len(rows) == len(bare_rows) + 2
    assert {0, 511} <= set(bare_columns)
    assert 256 not in columns


def test_directions_that_are_no_numbers_are_refused_in_one_line():
    with pytest.raises(InvalidInput, match=r"directions must be numbers, none of them NaN"):
        GRID.cells_of([[1.0, np.nan, 0.0]])


def test_ranges_are_norms_to_the_last_bit():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(10_000, 3)) * 10.0 ** rng.integers(-3, 3, (10_000, 1))
    cells = np.zeros(len(points), np.int64)
    found = AngularGrid().ranges_to(cells, points)
    assert found.tobytes() == np.linalg.norm(points, axis=1).tobytes()
