"""The steps of the cluster detector by themselves."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.core.frames import turned
from care_sim.core.grid import AngularGrid
from care_sim.perception.cluster.boxes import Sides, _closeness, best_guess, fit_sides
from care_sim.perception.cluster.points import (
    COLUMNS_APART,
    NEAR_RADIUS_M,
    STEEPEST,
    _even,
    cluster_radius,
    clusters_of,
    heights_above,
    road_plane,
)
from tests.helpers.made_points import HEIGHT, face, road, shell


@pytest.mark.parametrize("slope", [0.0, 0.01, -0.025])
def test_the_slope_of_a_road_is_found_beside_buildings_and_cars(slope):
    bodies = [face((-20, 9), (20, 9), 0.0, 6.0), shell(8, -4, 0.2, 4.61, 1.95, 1.72)]
    plane = road_plane(np.concatenate([road(slope=slope), *bodies]), HEIGHT)
    assert plane[:2] == pytest.approx([slope, 0], abs=0.002)
    assert plane[2] == pytest.approx(-HEIGHT, abs=0.02)


def test_points_of_a_body_alone_do_not_become_the_road():
    person = shell(10, 0, 0.0, 0.73, 0.66, 1.76)
    heights = heights_above(person, road_plane(person, HEIGHT))
    assert heights.max() > 1.2


def test_without_points_the_road_is_level():
    assert road_plane(np.empty((0, 3)), HEIGHT).tolist() == [0, 0, -HEIGHT]


def test_two_points_make_no_road():
    """A kerb stone, 0.1 m high, would tilt it."""
    stone = np.array([[8.0, 1.0, 0.1 - HEIGHT], [8.0, 1.5, 0.1 - HEIGHT]])
    assert road_plane(stone, HEIGHT).tolist() == [0, 0, -HEIGHT]


@pytest.mark.parametrize(
    ("range_m", "radius"), [(3, NEAR_RADIUS_M), (12, NEAR_RADIUS_M), (40, 0.982)]
)
def test_the_radius_grows_with_the_range_once_columns_are_far_apart(grid, range_m, radius):
    assert cluster_radius(grid, range_m) == pytest.approx(radius, abs=1e-3)


@example(range_m=12.0, bearing=0.0, way=0.0)
@given(range_m=st.floats(3, 50), bearing=st.floats(-np.pi, np.pi), way=st.floats(-np.pi, np.pi))
def test_two_points_belong_together_up_to_the_radius(grid, range_m, bearing, way):
    """Whichever way the second lies, also across the seam of the azimuths.

    Where the radius begins to grow the plane is bent at a right angle: a step across the bend is as
    short there as the hypotenuse of its two parts, at the least 1 / sqrt(2) of it.
    """
    first = range_m * np.array([np.cos(bearing), np.sin(bearing)])
    step = cluster_radius(grid, range_m) * np.array([np.cos(way), np.sin(way)])
    assert len(clusters_of(np.array([first, first + 0.93 * step]), grid)) == 1
    bend = NEAR_RADIUS_M / (COLUMNS_APART * grid.column_width)
    is_beyond = np.hypot(*np.array([first, first + 1.07 * step]).T) > bend
    apart = 1.07 if is_beyond[0] == is_beyond[1] else 1.5
    assert len(clusters_of(np.array([first, first + apart * step]), grid)) == 2


def test_clusters_hold_every_point_once(grid):
    plan = np.random.default_rng(0).uniform(-40, 40, (500, 2))
    assert np.array_equal(np.sort(np.concatenate(clusters_of(plan, grid))), np.arange(500))


def dbscan(open3d, plan, grid):
    """The clusters by Open3D."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(_even(plan, grid)))
    labels = np.asarray(cloud.cluster_dbscan(eps=1.0, min_points=1))
    return [np.flatnonzero(labels == label).tolist() for label in range(labels.max() + 1)]


@pytest.mark.parametrize("seed", range(10))
def test_the_clusters_are_those_of_dbscan_in_its_order(open3d, grid, seed):
    """Crowded and sparse clouds; on a lattice of the radius whole rows of points tie."""
    rng = np.random.default_rng(seed)
    for plan in (
        rng.uniform(-40, 40, (2000, 2)),
        rng.normal(0, 5, (2000, 2)),
        NEAR_RADIUS_M * rng.integers(-15, 15, (300, 2)),
    ):
        clusters = [rows.tolist() for rows in clusters_of(plan, grid)]
        assert clusters == dbscan(open3d, plan, grid)


@pytest.mark.parametrize("degrees", [0, 38, 60, 80, 121])
def test_the_corner_of_a_rectangle_is_fitted(degrees):
    sides = fit_sides(shell(12, 4, np.deg2rad(degrees), 4.6, 1.9, 1.0)[:, :2])
    assert np.sort(sides.spans) == pytest.approx([1.9, 4.6], abs=0.12)
    assert sides.middle @ sides.axes == pytest.approx([12, 4], abs=0.12)
    turns = (np.rad2deg(np.arctan2(*sides.axes[0][::-1])) - degrees) % 90
    assert min(turns, 90 - turns) <= 1.0


@pytest.mark.parametrize("end", [1, -1])
@pytest.mark.parametrize("degrees", [20, 40, 60])
def test_the_long_side_decides_whichever_end_is_shown_beside_it(degrees, end):
    """Forty points on one side, three off a ragged end that leads to its left or right."""
    side = np.column_stack([np.linspace(0, 4.6, 40), np.zeros(40)])
    ragged = np.array([[0.0, 0.3], [-0.05, 0.6], [0.05, 0.9]]) * [1, end]
    sides = fit_sides(
        turned(np.concatenate([side, ragged]), np.deg2rad(degrees)) + np.array([12.0, 4.0])
    )
    assert np.rad2deg(np.arctan2(*sides.axes[0][::-1])) == pytest.approx(degrees, abs=1.0)


def test_one_point_is_a_rectangle_without_extent():
    sides = fit_sides(np.array([[5.0, 2.0]]))
    assert sides.spans == pytest.approx([0, 0])
    assert sides.middle @ sides.axes == pytest.approx([5, 2])


def test_a_ramp_alone_does_not_become_the_road():
    ramp = np.column_stack(
        [np.linspace(4, 6, 50), np.linspace(-1, 1, 50), np.linspace(-0.3, 0.3, 50) - HEIGHT]
    )
    assert np.abs(road_plane(ramp, HEIGHT)[:2]).max() <= STEEPEST


def test_a_round_post_is_fitted_alike_from_every_column(grid):
    """Two headings fit it equally well, to the left and to the right of its bearing."""
    around = np.linspace(np.pi / 2, 3 * np.pi / 2, 9)
    post = np.column_stack([10 + 0.3 * np.cos(around), 0.3 * np.sin(around)])
    axes = np.array(
        [
            turned(fit_sides(turned(post, c * grid.column_width)).axes[0], -c * grid.column_width)
            for c in range(0, 512, 7)
        ]
    )
    assert np.ptp(axes, axis=0) == pytest.approx([0, 0], abs=1e-6)


@pytest.mark.parametrize("span", [0.3, 0.7, 1.8])
@pytest.mark.parametrize("bit", [1e-13, -1e-13])
def test_a_last_bit_does_not_choose_between_two_headings_that_fit_alike(span, bit):
    low = np.array([8.0, 8.0])

    def guess(moved):
        return best_guess(
            Sides(np.eye(2), low, low + span + [0.0, moved]), 1.7, -HEIGHT, HEIGHT, AngularGrid()
        )

    assert guess(bit).label == guess(0.0).label
    assert guess(bit).box == pytest.approx(guess(0.0).box)


@pytest.mark.parametrize("bit", [1e-13, -1e-13])
def test_a_last_bit_does_not_choose_the_side_that_is_shown(bit):
    """Of points whose mean is midway, both sides are as near."""
    even = np.array([[[0.0, 4.0, 4.0, 1.0, 6.0], [0.0, 10.0, 20.0, 30.0, 60.0]]])
    moved = even.copy()
    moved[0, 0, 1] += bit
    assert _closeness(moved) == pytest.approx(_closeness(even))
