"""The detector that sees points only: scenes of points made by hand, whose answer is known."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import turned
from care_sim.core.types import CLASSES
from care_sim.perception.cluster.detector import ClusterDetector
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


def test_of_a_car_ahead_only_the_back_is_seen_and_the_rest_is_completed(detector):
    found = detector.detect(
        np.concatenate([road(), face((10, 0.97), (10, -0.97), 0.3, 1.7)]), HEIGHT
    )
    assert names(found) == ["car"]
    assert found.boxes[0, [0, 1, 3, 4]] == pytest.approx([10 + 4.61 / 2, 0, 4.61, 1.95], abs=0.15)


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


def test_no_points_no_detections(detector):
    found = detector.detect(np.empty((0, 3)), HEIGHT)
    assert (len(found), found.boxes.shape, found.scores.shape) == (0, (0, 7), (0,))


def test_two_people_a_metre_apart_are_two(detector):
    people = [shell(8, side, 0.0, *PERSON) for side in (0.5, -0.5)]
    found = detector.detect(np.concatenate([road(), *people]), HEIGHT)
    assert names(found) == ["pedestrian", "pedestrian"]
    assert sorted(found.boxes[:, 1]) == pytest.approx([-0.5, 0.5], abs=0.15)


def test_a_wall_is_no_object(detector):
    assert (
        len(detector.detect(np.concatenate([road(), face((-20, 9), (20, 9), 0.3, 6.0)]), HEIGHT))
        == 0
    )


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


def test_more_points_are_surer(detector):
    people = np.concatenate([shell(8, 3, 0.0, *PERSON), shell(8, -3, 0.0, *PERSON)[::3]])
    found = detector.detect(np.concatenate([road(), people]), HEIGHT)
    assert found.returns[0] > found.returns[1]
    assert found.scores == pytest.approx(1 - 1 / np.sqrt(found.returns))


def test_a_part_that_hangs_apart_is_not_a_body_of_its_own(detector):
    """The back of a car ahead, and 2 m on, where its mirror would be, points of its side."""
    mirror = shell(12.0, -0.8, 0.0, 0.3, 0.3, 1.5)
    car = face((10, 0.97), (10, -0.97), 0.3, 1.7)
    assert names(detector.detect(np.concatenate([road(), mirror]), HEIGHT)) == ["pedestrian"]
    assert names(detector.detect(np.concatenate([road(), mirror, car]), HEIGHT)) == ["car"]


def test_the_roof_beneath_the_sensor_is_no_object(detector):
    assert len(detector.detect(shell(1.0, 0.0, 0.0, *PERSON), HEIGHT)) == 0


@pytest.mark.parametrize("points", [np.zeros(3), np.zeros((4, 2)), np.full((4, 3), np.nan)])
def test_what_are_no_points_is_refused(detector, points):
    with pytest.raises(InvalidInput, match=r"points must be \(P, 3\) finite numbers"):
        detector.detect(points, HEIGHT)


def test_no_extra_is_needed(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    assert names(ClusterDetector().detect(shell(8, 6, 0.4, *CAR), HEIGHT)) == ["car"]


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
