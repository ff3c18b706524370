"""The grids of several LiDARs as one."""

import pickle

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.cells.boxes import box_corners
from care_sim.core.cells.order import SetMargins, reordered
from care_sim.core.cells.sets import CellSets
from care_sim.core.cells.stack import GridStack
from care_sim.core.defaults import CELL_ORDERS
from care_sim.core.forgetting import Forgetting, ForgettingRules
from care_sim.core.grid import AT_LIDAR_M, LEAST_DEPTH_M, AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from tests.core.test_grid import boxes, sample
from tests.helpers.lidars import DEGREE, LEFT, RIGHT, ROOF, STACK

ORIGIN = (0.0, 0.0, 0.0)
ALONE = GridStack((ROOF,), (ORIGIN,))
SIDES = GridStack((ROOF, LEFT, RIGHT), ((0.0, 0.0, 0.0), (2.3, 0.65, -1.3), (2.3, -3.0, -1.3)))
"""The third so far to the side that its own azimuths of near things differ by much."""
TALL = AngularGrid(64, 33, 60 * DEGREE, -60 * DEGREE)
MARGINS = SetMargins(2, 1)
FRONT = PinholeCamera(horizontal_fov=90 * DEGREE, position=(0.7, 0.0, -0.3))
"""At the first LiDAR, and not at the others."""

ahead = st.tuples(
    st.floats(9, 45),
    st.floats(-30, 30),
    st.floats(-2, 2),
    st.floats(0.3, 3),
    st.floats(0.3, 3),
    st.floats(0.5, 3),
    st.floats(-4, 4),
).map(np.array)


def detection(image_boxes):
    count = len(image_boxes)
    zeros = np.zeros(count)
    whole = np.zeros(count, np.int64)
    return ImageDetections(whole, zeros + 1, np.array(image_boxes, float), whole, zeros, zeros)


def test_cells_are_numbered_row_by_row_and_lidar_by_lidar():
    assert STACK.shape == (16, 64)
    assert STACK.size == 1024
    assert [head.first for head in STACK.heads] == [0, 512, 768]
    assert [head.rows for head in STACK.heads] == [(0, 7), (8, 11), (12, 15)]
    for head in STACK.heads:
        assert np.array_equal(STACK.directions[head.cells], head.grid.directions)
    assert [head.rows for head in ROOF.heads] == [(0, 7)]
    assert STACK.range_m == 80.0


def test_points_lie_along_the_rays_of_their_own_lidar():
    cells, ranges = np.array([3, 600, 900]), np.array([10.0, 20.0, 30.0])
    points = STACK.points(cells, ranges)
    for point, cell, distance, head in zip(points, cells, ranges, STACK.heads, strict=True):
        own = head.grid.directions[cell - head.first] * distance
        assert point == pytest.approx(np.array(head.place) + own)
    assert STACK.ranges_to(cells, points) == pytest.approx(ranges)
    assert STACK.ranges_to(cells, STACK.stretched(cells, points, ranges)) == pytest.approx(
        ranges**2
    )
    found = STACK.cells_at(points)
    assert [found[n, n] for n in range(3)] == cells.tolist()
    assert STACK.reach_of(cells).tolist() == [50.0, 80.0, 80.0]


@given(st.lists(boxes, max_size=4), st.integers(0, 9), st.sampled_from(CELL_ORDERS[1:]))
def test_a_stack_of_one_is_its_grid_to_the_last_bit(some, most, order):
    tracked = np.array(some).reshape(-1, 7)
    hulls = [grid.hulls(tracked, 2, 1) for grid in (ALONE, ROOF)]
    assert_same(*hulls)
    assert_same(*(reordered(hulls[0], order, grid, MARGINS, most) for grid in (ALONE, ROOF)))
    spans = FRONT.project_boxes(tracked)
    seen = detection(spans[~np.isnan(spans).any(axis=1)])
    assert_same(*(wedges(seen, Rig(grid, (FRONT,))) for grid in (ALONE, ROOF)))
    cells = np.arange(ROOF.size)
    ranges = np.linspace(0, 50, ROOF.size)
    points = ROOF.points(cells, ranges)
    assert np.array_equal(ALONE.points(cells, ranges), points)
    assert np.array_equal(ALONE.cells_at(points), ROOF.cells_at(points))


def assert_same(one, other):
    assert np.array_equal(one.cells, other.cells)
    assert np.array_equal(one.sizes, other.sizes)


@given(st.lists(boxes, min_size=1, max_size=3), st.integers(0, 2**32 - 1))
def test_every_lidar_finds_the_points_of_a_box_in_its_hull(some, seed):
    for box, hull in zip(some, SIDES.hulls(np.array(some), 0, 0), strict=True):
        assert (np.diff(hull) > 0).all()
        cells = SIDES.cells_at(sample(box, seed, 60))
        assert {*cells[cells >= 0].tolist()} <= {*hull.tolist()}


@given(ahead, st.integers(0, 2**32 - 1))
def test_what_a_camera_shows_is_in_the_wedge_of_every_lidar_that_sees_it(box, seed):
    """Its centre, and every other point: the wedge of a LiDAR far from the camera is not that of
    the camera's directions.
    """
    (span,) = FRONT.project_boxes(box[None])
    assume(not np.isnan(span).any())
    # The camera looks straight ahead: its depth is along x.
    assume((box_corners(box[None])[0, :, 0] > FRONT.position[0] + LEAST_DEPTH_M).all())
    (wedge,) = wedges(detection([span]), Rig(SIDES, (FRONT,), azimuth_margin=0, elevation_margin=0))
    found = SIDES.cells_at(np.vstack([box[:3], sample(box, seed, 60)]))
    # The first LiDAR is at the camera, so that its wedge is the paper's, without parallax.
    others = found[:, 1:]
    assume((others >= 0).any())
    assert {*others[others >= 0].tolist()} <= {*wedge.tolist()}


@given(
    st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(-2, 2)),
    st.tuples(st.floats(0, 300), st.floats(0, 170), st.floats(5, 320), st.floats(5, 180)),
    st.sampled_from([TALL, RIGHT]),
    st.integers(0, 2**32 - 1),
)
def test_a_wedge_from_afar_holds_all_that_lies_behind_the_image_box(place, corner, grid, seed):
    """Also where the LiDAR stands amid it, and of wide boxes, whose edges come nearer than their
    corners.
    """
    assume(np.linalg.norm(place) > AT_LIDAR_M)
    left, top, width, height = corner
    camera = PinholeCamera(position=place, horizontal_fov=90 * DEGREE)
    box = left, top, min(left + width, 320), min(top + height, 180)
    (wedge,) = grid.wedges(camera.box_rays([box]), 0, 0, np.array([place]))
    # Along the edges of the box as often as within it, and near by as often as far away.
    shares = np.random.default_rng(seed).uniform(0, 1, (400, 3))
    shares[:200, 1] = np.round(shares[:200, 1])
    pixels = np.array(box[:2]) + shares[:, :2] * np.subtract(box[2:], box[:2])
    depths = LEAST_DEPTH_M * 10 ** shares[:, 2]
    points = np.array(place) + camera.rays(pixels) * depths[:, None]
    cells = grid.cells_of(points)
    assert {*cells[cells >= 0].tolist()} <= {*wedge.tolist()}


def test_a_lidar_away_from_the_camera_looks_where_the_camera_does_not():
    """A person 10 m ahead of a LiDAR that stands 3 m to the right of the camera is 16.7 degrees to
    the left of it, and straight ahead of the camera.
    """
    aside = GridStack((ROOF, ROOF), ((0.0, 0.0, 0.0), (0.0, -3.0, 0.0)))
    camera = PinholeCamera()
    rig = Rig(aside, (camera,), azimuth_margin=0, elevation_margin=0)
    # A box around the middle of the picture, two pixels wide.
    (wedge,) = wedges(detection([(159.0, 89.0, 161.0, 91.0)]), rig)
    width = 360 / 64
    own = {int(cell) % 64 for cell in wedge if cell < ROOF.size}
    other = {int(cell) % 64 for cell in wedge if cell >= ROOF.size}
    assert own == {31, 32}
    # From LEAST_DEPTH_M on, where it is 31 degrees to the left, to as far as it reaches: 3 degrees.
    nearest, farthest = np.rad2deg(np.arctan2(3, [LEAST_DEPTH_M, LEAST_DEPTH_M + 50 + 3]))
    expected = range(32 + int(farthest / width), 32 + int(nearest / width) + 1)
    assert other == {*expected}


def test_a_camera_near_the_lidar_counts_as_standing_at_it():
    near, far = (PinholeCamera(position=(0.0, AT_LIDAR_M * factor, 0.0)) for factor in (0.99, 1.01))
    at = PinholeCamera()
    seen = detection([(100.0, 80.0, 140.0, 120.0)])
    same, moved = (
        [wedges(seen, Rig(ROOF, (camera,)))[0].tolist() for camera in pair]
        for pair in ((near, at), (far, at))
    )
    assert same[0] == same[1]
    assert moved[0] != moved[1]


def test_wedges_keep_the_order_of_their_boxes():
    """One of the two cameras is at the LiDAR."""
    cameras = PinholeCamera(), PinholeCamera(position=(2.0, 0.0, 0.0))
    spans = [(10.0 * n, 80.0, 10.0 * n + 30, 120.0) for n in range(4)]
    both = detection(spans)
    both = ImageDetections(
        both.classes, both.confidences, both.boxes, np.array([1, 0, 1, 0]), both.ages, both.ages
    )
    together = wedges(both, Rig(ROOF, cameras))
    for n, camera in enumerate((1, 0, 1, 0)):
        (alone,) = wedges(detection([spans[n]]), Rig(ROOF, (cameras[camera],)))
        assert together[n].tolist() == alone.tolist()


def test_the_cores_of_all_lidars_come_before_all_margins():
    """Each core is a block without its two columns and its row on every side; at the first row of
    its LiDAR the second has no margin, as it has none at the top of a grid.
    """
    block = [row * 64 + column for row in (3, 4, 5) for column in range(20, 27)]
    other = [row * 64 + column for row in (8, 9, 10) for column in range(30, 37)]
    (listed,) = reordered([np.array(block + other)], "core-spread", STACK, MARGINS)
    core = {4 * 64 + column for column in (22, 23, 24)}
    core |= {row * 64 + column for row in (8, 9) for column in (32, 33, 34)}
    assert {*listed[: len(core)].tolist()} == core


def test_a_camera_apart_goes_round_with_the_car_after_its_picture():
    """The car has turned 90 degrees to the left since: the camera that was 2 m ahead stood where is
    now 2 m to the right, and what it saw straight ahead is there.
    """
    then = PinholeCamera(position=(2.0, 0.0, 0.0))
    now = PinholeCamera(position=(0.0, -2.0, 0.0), yaw=-np.pi / 2)
    seen = detection([(150.0, 80.0, 200.0, 110.0)])
    turned = ImageDetections(
        seen.classes, seen.confidences, seen.boxes, seen.cameras, seen.ages, seen.ages + np.pi / 2
    )
    for grid in (ROOF, STACK):
        (old,) = wedges(turned, Rig(grid, (then,)))
        (new,) = wedges(seen, Rig(grid, (now,)))
        assert old.tolist() == new.tolist()
        assert len(old)


def test_every_cell_has_the_number_of_its_lidar():
    cells = np.array([900, 0, 511, 512, 767, 768])
    assert STACK.lidars_of(cells).tolist() == [2, 0, 0, 1, 1, 2]
    assert ROOF.lidars_of(cells[1:3]).tolist() == [0, 0]


def test_forgetting_keeps_what_the_lidar_with_the_narrowest_columns_needs():
    """A track 20 m ahead, 0.7 m uncertain: 2.0 degrees, one column of the roof's 5.6. From the
    corner it is 17.7 m and 2.3 degrees away: two of its columns of 1.9.
    """
    rules = ForgettingRules(position_sigma_m=0.7)
    track = Tracks(
        np.array([0]),
        np.array([0]),
        np.array([[20.0, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0]]),
        np.zeros((1, 2)),
        np.array([0]),
        np.array([5]),
    )
    margins = []
    for grid in (ROOF, STACK):
        forgetting = Forgetting(rules, Rig(grid, azimuth_margin=9))
        for _ in range(20):
            forgetting.advance(track, Ego())
        margins.append(forgetting.margins(track)[0].tolist())
    assert margins == [[1], [2]]


@pytest.mark.parametrize(
    ("grids", "places", "words"),
    [
        ((), (), "grids of a stack must be AngularGrids"),
        ((ROOF, LEFT), (ORIGIN,), "places of a stack must be one for each of its 2 grids"),
        ((ROOF,), ((0.0, 1.0, 0.0),), "places of a stack must begin at 0, 0, 0"),
        ((ROOF,), ((0.0, 1.0),), "places of a stack must be x, y and z in metres"),
        ((ROOF, LEFT), (ORIGIN, (0.0, 99.0, 0.0)), "y of places of a stack must"),
        ((ROOF, AngularGrid(128, 4)), (ORIGIN, ORIGIN), "as many columns each, got 64 and 128"),
        ((AngularGrid(64, 600),) * 2, (ORIGIN, ORIGIN), "at most 1024 rows in all, got 1200"),
    ],
)
def test_what_is_no_stack_is_refused(grids, places, words):
    with pytest.raises(InvalidInput, match=words):
        GridStack(grids, places)


def test_a_copy_leaves_its_tables_behind():
    whole = pickle.dumps(STACK)
    assert STACK.directions.shape == (1024, 3)
    assert pickle.dumps(STACK) == whole
    assert pickle.loads(whole) == STACK
    assert isinstance(STACK.hulls(np.empty((0, 7))), CellSets)
    assert not len(STACK.hulls(np.empty((0, 7))))
