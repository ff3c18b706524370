"""The detector that sees points only: scenes of points made by hand, whose answer is known."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.core.frames import Frame, turned
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.perception.cluster.boxes import Sides, best_guess, fit_sides
from care_sim.perception.cluster.detector import ClusterDetector
from care_sim.perception.cluster.points import (
    COLUMNS_APART,
    NEAR_RADIUS_M,
    _even,
    cluster_radius,
    clusters_of,
    road_plane,
)
from care_sim.world.bodies import CATALOGUE
from tests.helpers.made_points import HEIGHT, face, road, shell

CAR, PERSON = (4.61, 1.95, 1.72), (0.73, 0.66, 1.76)


@pytest.fixture(scope="module")
def detector():
    return ClusterDetector()


def names(detections):
    return [CLASSES[label] for label in detections.classes.tolist()]


@pytest.mark.parametrize("yaw", [0.4, 1.2, 2.5, -0.7])
def test_two_sides_of_a_car_give_its_class_and_box(detector, yaw):
    points = np.concatenate([road(), shell(8, 6, yaw, *CAR)])
    found = detector.detect(points, HEIGHT)
    assert names(found) == ["car"]
    assert np.hypot(*(found.boxes[0, :2] - [8, 6])) < 0.3
    assert found.boxes[0, 3:6] == pytest.approx(CAR, abs=0.3)
    assert np.sin(found.boxes[0, 6] - yaw) == pytest.approx(0, abs=0.05)
    assert np.cos(found.boxes[0, 6]) * 8 + np.sin(found.boxes[0, 6]) * 6 > 0, (
        "known but for half a turn: away from here"
    )
    assert found.boxes[0, 2] - found.boxes[0, 5] / 2 == pytest.approx(-HEIGHT, abs=0.1)


@pytest.mark.parametrize(
    ("name", "size"),
    [("pedestrian", PERSON), ("bicycle", (1.68, 0.6, 1.27)), ("bus", (11.19, 2.94, 3.47))],
)
def test_classes_by_size(detector, name, size):
    found = detector.detect(np.concatenate([road(), shell(12, -5, 1.0, *size)]), HEIGHT)
    assert names(found) == [name]
    assert np.hypot(*(found.boxes[0, :2] - [12, -5])) < 0.4


def test_road_alone_holds_nobody(detector):
    assert len(detector.detect(road(), HEIGHT)) == 0


def test_two_people_a_metre_apart_are_two(detector):
    people = [shell(8, side, 0.0, *PERSON) for side in (0.5, -0.5)]
    found = detector.detect(np.concatenate([road(), *people]), HEIGHT)
    assert names(found) == ["pedestrian", "pedestrian"]
    assert sorted(found.boxes[:, 1]) == pytest.approx([-0.5, 0.5], abs=0.15)


def test_a_slope_is_no_object_and_hides_none(detector):
    """At 3% the road rises 0.9 m over 30 m: as high as a person's hip."""
    person = shell(20, 2, 0.3, *PERSON) + np.array([0, 0, 0.03 * 20])
    found = detector.detect(np.concatenate([road(slope=0.03), person]), HEIGHT)
    assert names(found) == ["pedestrian"]
    assert found.boxes[0, 2] - found.boxes[0, 5] / 2 == pytest.approx(0.6 - HEIGHT, abs=0.1)


def test_two_points_are_too_few_and_three_enough(detector):
    """At the range where a person is two columns wide, at its two edges, up to its head."""
    person = np.array([[20, 0.3, 1.7], [20, -0.3, 1.6], [20, 0.0, 1.2]]) - [0, 0, HEIGHT]
    assert len(detector.detect(person[:2], HEIGHT)) == 0
    assert names(detector.detect(person, HEIGHT)) == ["pedestrian"]


def test_a_part_that_hangs_apart_is_not_a_body_of_its_own(detector):
    """The back of a car ahead, and 2 m on, where its mirror would be, points of its side."""
    mirror = shell(12.0, -0.8, 0.0, 0.3, 0.3, 1.5)
    car = face((10, 0.97), (10, -0.97), 0.3, 1.7)
    assert names(detector.detect(np.concatenate([road(), mirror]), HEIGHT)) == ["pedestrian"]
    assert names(detector.detect(np.concatenate([road(), mirror, car]), HEIGHT)) == ["car"]


SIZES = st.sampled_from([CAR, PERSON, (6.74, 2.46, 2.73), (1.68, 0.6, 1.27)])
PLACED = st.tuples(st.floats(8, 40), st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi), SIZES)


@st.composite
def scenes(draw):
    bodies = draw(st.lists(PLACED, min_size=1, max_size=3))
    shells = [
        shell(r * np.cos(bearing), r * np.sin(bearing), yaw, *size)
        for r, bearing, yaw, size in bodies
    ]
    return np.concatenate([road(step=3.0), *shells])


@given(points=scenes(), seed=st.integers(0, 1000))
def test_the_order_of_the_points_does_not_matter(detector, points, seed):
    found = detector.detect(points, HEIGHT)
    shuffled = detector.detect(np.random.default_rng(seed).permutation(points), HEIGHT)
    for column in ("classes", "boxes", "returns", "scores"):
        assert np.array_equal(getattr(found, column), getattr(shuffled, column))


@given(points=scenes(), columns=st.integers(1, 511))
def test_a_turn_by_whole_columns_turns_the_boxes(detector, grid, points, columns):
    angle = columns * grid.column_width
    found = detector.detect(points, HEIGHT)
    again = detector.detect(turned(points, angle), HEIGHT)
    assert names(again) == names(found)
    assert again.boxes[:, :3] == pytest.approx(turned(found.boxes[:, :3], angle), abs=1e-4)
    assert again.boxes[:, 3:6] == pytest.approx(found.boxes[:, 3:6], abs=1e-4)
    assert np.cos(again.boxes[:, 6] - found.boxes[:, 6] - angle) == pytest.approx(
        np.ones(len(found)), abs=1e-4
    )


@pytest.mark.parametrize("slope", [0.0, 0.01, -0.025])
def test_the_slope_of_a_road_is_found_beside_buildings_and_cars(slope):
    bodies = [face((-20, 9), (20, 9), 0.0, 6.0), shell(8, -4, 0.2, 4.61, 1.95, 1.72)]
    plane = road_plane(np.concatenate([road(slope=slope), *bodies]), HEIGHT)
    assert plane[:2] == pytest.approx([slope, 0], abs=0.002)
    assert plane[2] == pytest.approx(-HEIGHT, abs=0.02)


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


HEADINGS = 8


def scan(world, grid):
    sensor = Frame(0.0, 0.0, HEIGHT, 0.0)
    ranges, _ = world.cast(sensor.origin, grid.directions, grid.range_m)
    hit = np.isfinite(ranges)
    return grid.directions[hit] * ranges[hit, None]


def share_found(world, grid, kind, ranges):
    """The share of places and headings at which `kind`, alone on the road, is found within 2 m in
    its class, and how many other detections there are, a scan.
    """
    detector, body = ClusterDetector(grid), world.add(CATALOGUE[kind], (0.0, 50.0, 0.0))
    found, others = [], []
    for number, (range_m, heading) in enumerate((r, h) for r in ranges for h in range(HEADINGS)):
        bearing = 2.4 * number
        x, y = turned(np.array([range_m, 0.0]), bearing)
        world.move(body, (float(x), float(y), bearing + 0.1 + heading * np.pi / HEADINGS))
        seen = detector.detect(scan(world, grid), HEIGHT)
        right = seen.classes == CLASSES.index(CATALOGUE[kind].label)
        near = np.hypot(seen.boxes[:, 0] - x, seen.boxes[:, 1] - y) <= 2
        found.append(bool((near & right).any()))
        others.append(len(seen) - found[-1])
    return np.mean(found), np.mean(others)


@pytest.mark.parametrize(
    ("kind", "ranges", "least"),
    [
        ("car", (6, 15, 25), 0.95),
        ("car", (35, 45), 0.8),
        ("truck", (8, 25, 45), 0.9),
        ("bus", (10, 25, 45), 0.95),
        ("bicycle", (5, 12), 0.9),
        ("pedestrian", (5, 12, 20), 0.9),
        ("pedestrian", (25, 30), 0.4),
    ],
)
def test_the_share_found_at_full_scan(bullet, grid, kind, ranges, least):
    found, others = share_found(bullet, grid, kind, ranges)
    assert found >= least
    assert others <= 0.75
