"""The interface: what reaches a real detector, and what it may return. The proxy over films."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import Detections
from care_sim.perception.points_only import BrokenDetector, PointsOnly, inside
from care_sim.perception.proxy import ReturnsProxy
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud
from tests.helpers.made_points import HEIGHT, shell

HERE = rf"\({Path(__file__).name}, line \d+\)"
"""Where code raises that is none of ours."""
CAR = np.array([8.0, 6.0, 0.86 - HEIGHT, 4.61, 1.95, 1.72, 0.4])
PERSON = np.array([12.0, -3.0, 0.88 - HEIGHT, 0.73, 0.66, 1.76, 0.0])
OBJECTS = Annotations(np.array([30, 7]), np.array([0, 4]), np.stack([CAR, PERSON]))


def cloud(*bodies):
    """A cloud of (object number, points)."""
    points = np.concatenate([points for _, points in bodies])
    numbers = np.concatenate([np.full(len(points), number) for number, points in bodies])
    return Cloud(np.arange(len(points)), points, numbers)


SCENE = cloud(
    (30, shell(8, 6, 0.4, 4.61, 1.95, 1.72)),
    (NO_OBJECT, np.full((5, 3), 20.0)),
    (7, PERSON[None, :3]),
)

FEW = f"returns must be whole numbers from 0 to the {len(SCENE)} points"


class Says:
    """Keeps what it was given, and returns what it was told to."""

    def __init__(self, found):
        self.found = found

    def detect(self, *given):
        self.given = given
        return self.found


def detections(**columns):
    right = {
        "classes": np.array([0]),
        "boxes": CAR[None],
        "returns": np.array([9]),
        "scores": np.array([0.5]),
    }
    return Detections(**{**right, **columns})


def test_a_real_detector_is_handed_points_and_a_height_and_no_more():
    real = Says(detections())
    PointsOnly("mine", real, HEIGHT).detect(SCENE, OBJECTS)
    points, height = real.given
    assert np.array_equal(points, SCENE.points)
    assert height == HEIGHT


def test_it_gets_the_fields_that_it_asks_for_in_their_order():
    real = Says(detections())
    real.fields = ("time_lag", "x", "y", "z", "ring", "intensity")
    zeros = np.zeros(len(SCENE))
    times, rings, strengths = (np.linspace(*ends, len(SCENE)) for ends in ((-1, 0), (0, 9), (0, 1)))
    told = replace(SCENE, times=times, rings=rings.astype(int), intensities=strengths)
    for shown, own in ((SCENE, [zeros] * 3), (told, [-times, rings.astype(int), strengths])):
        PointsOnly("mine", real, HEIGHT).detect(shown, OBJECTS)
        points, _ = real.given
        lag, ring, strength = own
        assert np.array_equal(points, np.column_stack([lag, SCENE.points, ring, strength]))


def test_its_points_are_its_own_to_change_and_lead_nowhere():
    """Not even to the unfired cells of which the fired ones are a view."""

    class Scribbles(Says):
        def detect(self, points, height):
            assert points.base is None
            points[:] = 0
            return self.found

    fired = Cloud(SCENE.cells[:50], SCENE.points[:50], SCENE.objects[:50])
    before = SCENE.points.copy()
    PointsOnly("mine", Scribbles(detections()), HEIGHT).detect(fired, OBJECTS)
    assert np.array_equal(SCENE.points, before)


def test_the_object_behind_a_detection_is_the_one_whose_returns_it_holds():
    nowhere = CAR + np.array([0, 30, 0, 0, 0, 0, 0])
    found = Detections(np.array([4, 0, 0]), np.stack([PERSON, CAR, nowhere]), np.array([3, 3, 3]))
    assert PointsOnly("mine", Says(found), HEIGHT).detect(SCENE, OBJECTS)[1].tolist() == [
        7,
        30,
        NO_OBJECT,
    ]


def test_most_returns_on_an_object_decide_and_those_on_the_road_do_not():
    """In the car's box: two returns of the person, three of the car, and four of the road."""
    amid = Cloud(
        np.arange(9), np.tile(CAR[:3], (9, 1)), np.array([7, 7, 30, 30, 30, *[NO_OBJECT] * 4])
    )
    assert PointsOnly("mine", Says(detections()), HEIGHT).detect(amid, OBJECTS)[1].tolist() == [30]


@pytest.mark.parametrize(
    ("found", "fault"),
    [
        ([], "must return Detections, got list"),
        (detections(classes=np.array([5])), "classes must be whole numbers from 0 to 4"),
        (detections(classes=np.array([0.5])), "classes must be whole numbers from 0 to 4"),
        (detections(classes=np.array([0, 1])), r"boxes must have the shape \(2, 7\), got \(1, 7\)"),
        (detections(boxes=CAR), r"boxes must have the shape \(1, 7\), got \(7,\)"),
        (detections(boxes=np.full((1, 7), np.nan)), "boxes must be finite, in single precision"),
        (detections(boxes=CAR[None] * 1e39), "boxes must be finite, in single precision"),
        (
            detections(boxes=CAR[None] * [1, 1, 1, 1, 1, 0, 1]),
            "lengths, widths and heights of boxes must be above 0",
        ),
        (
            detections(boxes=np.zeros((1, 7))),
            "lengths, widths and heights of boxes must be above 0",
        ),
        (detections(returns=np.array([-1])), FEW),
        (detections(returns=np.array([len(SCENE) + 1])), FEW),
        (detections(returns=np.array([2.5])), FEW),
        (detections(returns="many"), "returns must be an array of numbers, got 'many'"),
        (detections(classes=None), "classes must be finite, in single precision"),
        (detections(classes=["car"]), r"classes must be an array of numbers, got \['car'\]"),
        (detections(scores=np.array([-0.1])), r"scores must lie in \[0, 1\]"),
        (detections(scores=np.array([1.5])), r"scores must lie in \[0, 1\]"),
        (detections(scores=np.array([])), r"scores must have the shape \(1,\), got \(0,\)"),
    ],
)
def test_what_is_no_detections_is_refused_with_the_detectors_name(found, fault):
    with pytest.raises(BrokenDetector, match=f"^detector mine:? {fault}$"):
        PointsOnly("mine", Says(found), HEIGHT).detect(SCENE, OBJECTS)


@pytest.mark.parametrize(("count", "allowed"), [(500, True), (501, False)])
def test_more_boxes_than_an_official_evaluation_takes_are_refused(count, allowed):
    many = Detections(np.zeros(count), np.tile(CAR, (count, 1)), np.ones(count))
    detector = PointsOnly("mine", Says(many), HEIGHT)
    if allowed:
        assert len(detector.detect(SCENE, OBJECTS)[0]) == count
    else:
        with pytest.raises(
            BrokenDetector, match=r"^detector mine: at most 500 detections are allowed, got 501$"
        ):
            detector.detect(SCENE, OBJECTS)


@pytest.mark.parametrize(
    ("error", "says"),
    [(SystemExit(3), "SystemExit: 3"), (InvalidInput("odd points"), "InvalidInput: odd points"),
     (RuntimeError("first\n  second"), "RuntimeError: first second")],
)  # fmt: skip
def test_whatever_a_detector_raises_is_one_line_with_its_name(error, says):
    class Raises:
        def detect(self, points, height):
            raise error

    with pytest.raises(
        BrokenDetector, match=rf"^detector mine fails on \d+ points: {says} {HERE}$"
    ):
        PointsOnly("mine", Raises(), HEIGHT).detect(SCENE, OBJECTS)


def test_lists_and_no_detections_are_welcome():
    listed, _ = PointsOnly("mine", Says(Detections([4], [PERSON.tolist()], [2])), HEIGHT).detect(
        SCENE, OBJECTS
    )
    assert (listed.classes.dtype, listed.boxes.dtype, listed.scores) == (np.int64, np.float64, None)
    for nothing in (
        Detections(np.array([]), np.empty((0, 7)), np.array([])),
        Detections([], [], [], []),
    ):
        found, objects = PointsOnly("mine", Says(nothing), HEIGHT).detect(SCENE, OBJECTS)
        assert (len(found), found.boxes.shape, len(objects)) == (0, (0, 7), 0)


def test_points_within_boxes():
    """A box that heads 45 degrees to the left: its ends lie there, and not to the right."""
    box = np.array([1.0, 2.0, 0.0, 4.0, 2.0, 1.0, np.pi / 4])
    points = np.array([[2.3, 3.3, 0.4], [2.3, 0.7, 0.4], [1.0, 2.0, 0.6]])
    assert inside(points, box[None]).tolist() == [[True, False, False]]
    assert inside(points, np.empty((0, 7))).shape == (0, 3)
    with pytest.raises(InvalidInput, match=r"boxes must have the shape \(n, 7\), got \(1, 6\)"):
        inside(points, box[None, :6])


def test_the_proxy_reports_objects_with_three_returns_and_their_true_boxes():
    found, objects = ReturnsProxy().detect(SCENE, OBJECTS)
    assert (objects.tolist(), found.classes.tolist()) == ([30], [0])
    assert found.boxes.tolist() == [CAR.tolist()]
    assert found.returns.tolist() == [np.count_nonzero(SCENE.objects == 30)]
    assert found.scores is None


def test_the_proxy_with_one_return_and_in_whatever_order_the_objects_come():
    found, objects = ReturnsProxy(min_returns=1).detect(SCENE, OBJECTS)
    assert (objects.tolist(), found.classes.tolist()) == ([7, 30], [4, 0])
    assert found.boxes.tolist() == [PERSON.tolist(), CAR.tolist()]
