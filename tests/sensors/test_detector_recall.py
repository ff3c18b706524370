"""Recall by height and visible share, and how both are read off a picture."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera_errors import UNHIDDEN, seen_as, whole_boxes
from care_sim.sensors.camera_profiles import YOLOX, RecallTable
from care_sim.sensors.false_boxes import box_areas
from care_sim.sensors.pictures import FRONT_CAMERA, Picture, class_table, faultless_detections
from care_sim.world.bodies import CATALOGUE

TABLE = RecallTable((10.0, 30.0), (0.5, 1.0), ((0.2, 0.4), (0.6, 0.8)))
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
HUGE, TINY = 1e6, 1e-3
TABLES = [group.recall for group in YOLOX.groups]


@pytest.mark.parametrize(
    ("height", "share", "recall"),
    [
        (10, 1.0, 0.6), (30, 0.5, 0.4), (20, 1.0, 0.7), (20, 0.75, 0.5),  # between four numbers
        (5, 1.0, 0.3), (30, 0.25, 0.2), (5, 0.25, 0.05),  # towards nothing
        (99, 1.0, 0.8), (0, 1.0, 0.0), (99, 0.0, 0.0),
    ],
)  # fmt: skip
def test_recall_is_linear_between_the_numbers_of_the_table(height, share, recall):
    assert TABLE.at(np.array([float(height)]), np.array([share])) == pytest.approx([recall])


@pytest.mark.parametrize("table", TABLES)
def test_a_huge_object_is_found_at_the_asymptote_and_a_tiny_one_never(table):
    at = table.at(np.array([HUGE, TINY, HUGE]), np.array([1.0, 1.0, 0.0]))
    assert at == pytest.approx([table.recalls[-1][-1], 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("table", TABLES)
@given(height=st.floats(0, 500), share=st.floats(0, 0.99), more=st.floats(0, 0.01))
def test_recall_is_a_chance_and_grows_with_what_is_visible(table, height, share, more):
    less, most = table.at(np.array([height, height]), np.array([share, share + more]))
    assert 0.0 <= less <= most + 1e-12
    assert most <= 1.0


def detections(*boxes):
    # Buses, whose whole box is the box round their pixels.
    rows = [(2, 0.9, *box, 0, 0.0, 0.0) for box in boxes]
    return IdentifiedDetections(
        ImageDetections.from_rows(np.array(rows, float)), np.arange(len(boxes))
    )


def test_the_share_is_that_of_the_whole_box_within_the_picture():
    box = np.array([[12.0, 1.0, -1.0, 0.6, 0.6, 1.8, 0.0]])
    ((left, top, right, bottom),) = whole_boxes(FRONT_CAMERA, box)
    middle = (top + bottom) / 2
    seen = detections((left, top, right, bottom), (left, top, right, middle))
    heights, shares = seen_as(seen, np.repeat(box, 2, axis=0), [FRONT_CAMERA], 480.0)
    # The front camera's focal length is 160 pixels, a third of this picture's.
    assert heights == pytest.approx(3.0 * (bottom - top))
    assert shares == pytest.approx([1.0, 0.5])


def test_a_share_that_the_source_annotates_counts():
    box = np.array([[12.0, 1.0, -1.0, 0.6, 0.6, 1.8, 0.0]])
    seen = detections(whole_boxes(FRONT_CAMERA, box)[0])
    told = IdentifiedDetections(seen.detections, seen.objects, np.array([0.7]))
    assert seen_as(told, box, [FRONT_CAMERA], 480.0)[1].tolist() == [0.7]


def test_boxes_end_at_the_edges_of_the_picture_and_behind_it_there_are_none():
    beside = np.array([[3.0, 3.0, -1.0, 4.0, 2.0, 1.6, 0.0], [-9.0, 0.0, -1.0, 4.0, 2.0, 1.6, 0.0]])
    spans = whole_boxes(FRONT_CAMERA, beside)
    assert spans[0, 0] == 0.0
    assert np.all((spans >= 0) & (spans <= [320, 180, 320, 180]))
    assert spans[1].tolist() == [0, 0, 0, 0]


def ratio_from_all_sides(bullet, kind):
    """Areas of the box round the pixels over that of the whole box, alone in the picture."""
    size, label = CATALOGUE[kind].size, CLASSES.index(CATALOGUE[kind].label)
    body = bullet.add(CATALOGUE[kind], (10.0, 0.0, 0.0))
    ratios = []
    for metres, yaw in product((10.0, 20.0, 30.0), np.linspace(0.0, np.pi, 8, endpoint=False)):
        bullet.move_all(np.array([body]), np.array([(metres, 2.0, yaw)]))
        local = SENSOR.boxes_to_local(np.array([[metres, 2.0, size[2] / 2, *size, yaw]]))
        picture = Picture.of(bullet.body_ids(FRONT_CAMERA, SENSOR))
        seen = faultless_detections([picture], class_table({body: label})).detections
        ratios += (box_areas(seen.boxes) / box_areas(whole_boxes(FRONT_CAMERA, local))).tolist()
    bullet.move_all(np.array([body]), np.array([(-99.0, 0.0, 0.0)]))
    return ratios


@pytest.mark.parametrize("label", CLASSES)
def test_the_share_that_shows_when_nothing_hides_is_the_median_of_the_class(bullet, label):
    kinds = [name for name, kind in CATALOGUE.items() if kind.label == label]
    ratios = [ratio for kind in kinds for ratio in ratio_from_all_sides(bullet, kind)]
    assert np.median(ratios) == pytest.approx(UNHIDDEN[label], abs=0.02)


def test_what_hides_the_lower_part_leaves_the_upper_one(bullet):
    size = CATALOGUE["pedestrian"].size
    body = bullet.add(CATALOGUE["pedestrian"], (15.0, 0.0, 0.0))
    bullet.add(CATALOGUE["skip"], (12.0, 0.0, 1.57))
    local = SENSOR.boxes_to_local(np.array([[15.0, 0.0, size[2] / 2, *size, 0.0]]))
    picture = Picture.of(bullet.body_ids(FRONT_CAMERA, SENSOR))
    _, (share,) = seen_as(
        faultless_detections([picture], class_table({body: 4})), local, [FRONT_CAMERA], 480.0
    )
    assert 0.05 < share < 0.4
