import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES, Detections, Ego, ImageDetections
from care_sim.loops.film import Shot
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sources.nuscenes.detections import MOST_BOXES, attribute, confidences, result_boxes
from care_sim.sources.nuscenes.films import nuscenes_film
from care_sim.sources.nuscenes.recordings import split_scenes
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_drive import KEYFRAMES, OBJECTS, SPLIT, write_drive

NOTHING = np.empty(0, np.int64)
CAR = [10.0, 2.0, -1.0, 4.6, 1.9, 1.7, 0.3]


def shot(sensor):
    nobody = Annotations(NOTHING, NOTHING, np.empty((0, 7)))
    identified = IdentifiedDetections(ImageDetections.from_rows(np.empty((0, 9))), NOTHING)
    return Shot(
        0.0, "sample", sensor, Ego(), nobody, identified, Cloud(NOTHING, np.empty((0, 3)), NOTHING)
    )


def detections(*names, box=CAR, returns=None, scores=None):
    classes = np.array([CLASSES.index(name) for name in names], dtype=np.int64)
    counts = np.full(len(names), 5) if returns is None else np.array(returns)
    return Detections(classes, np.tile(box, (len(names), 1)), counts, scores)


def test_a_box_has_the_place_heading_and_velocity_of_the_world_and_its_width_first():
    sensor = Frame(100.0, 50.0, 1.84, np.pi / 2)
    (found,) = result_boxes(shot(sensor), detections("car"), np.array([[3.0, 0.0]]))
    assert found.pop("translation") == pytest.approx([98.0, 60.0, 0.84])
    half = (np.pi / 2 + 0.3) / 2
    assert found.pop("rotation") == pytest.approx([np.cos(half), 0, 0, np.sin(half)])
    assert found.pop("velocity") == pytest.approx([0.0, 3.0])
    assert found == {
        "sample_token": "sample",
        "size": [1.9, 4.6, 1.7],
        "detection_name": "car",
        "detection_score": 5 / 8,
        "attribute_name": "vehicle.moving",
    }


angles = st.floats(-np.pi, np.pi)


@given(st.floats(-500, 500), st.floats(-500, 500), angles, angles)
def test_a_box_of_the_world_comes_back_from_any_sensor_that_stands_upright(x, y, yaw, heading):
    sensor = Frame(x, y, 1.84, yaw)
    world = np.array([[3.0, -4.0, 0.8, 4.6, 1.9, 1.7, heading]])
    (found,) = result_boxes(
        shot(sensor), detections("car", box=sensor.boxes_to_local(world)[0]), np.zeros((1, 2))
    )
    assert found["translation"] == pytest.approx(world[0, :3], abs=1e-9)
    w, _, _, z = found["rotation"]
    assert (w * np.cos(heading / 2) + z * np.sin(heading / 2)) ** 2 == pytest.approx(1.0)


def test_the_annotations_of_a_database_come_back_as_its_tables_hold_them(tmp_path):
    """Read into the frame of a tilted, turned, driving sensor, and written out again."""
    tables = Database(write_drive(tmp_path / "nuscenes"))
    compared = 0
    for scene in split_scenes(tables):
        for moment in nuscenes_film(tables, scene).shots:
            truth = moment.annotations
            counts = np.arange(100, 100 - len(truth), -1)
            still = np.zeros((len(truth), 2))
            found = result_boxes(moment, Detections(truth.classes, truth.boxes, counts), still)
            for box, row in zip(found, tables.annotations(moment.token), strict=True):
                assert box["sample_token"] == moment.token
                assert box["translation"] == pytest.approx(row["translation"], abs=1e-6)
                assert box["size"] == pytest.approx(row["size"])
                assert abs(np.dot(box["rotation"], row["rotation"])) == pytest.approx(1.0, abs=1e-6)
                compared += 1
    assert compared == len(SPLIT) * KEYFRAMES * len(OBJECTS)


@pytest.mark.parametrize(
    ("name", "standing", "moving"),
    [
        ("car", "vehicle.parked", "vehicle.moving"),
        ("truck", "vehicle.parked", "vehicle.moving"),
        ("bus", "vehicle.parked", "vehicle.moving"),
        ("bicycle", "cycle.without_rider", "cycle.with_rider"),
        ("pedestrian", "pedestrian.standing", "pedestrian.moving"),
    ],
)
def test_the_speed_tells_the_attribute(name, standing, moving):
    assert [attribute(name, speed) for speed in (0.0, 0.5, 0.51, 9.0)] == [
        standing,
        standing,
        moving,
        moving,
    ]
    velocities = np.array([[0.3, 0.3], [-0.4, -0.4]])
    found = result_boxes(shot(Frame(0, 0, 0, 1.0)), detections(name, name), velocities)
    assert [box["attribute_name"] for box in found] == [standing, moving]


def test_confidence_grows_with_the_returns_and_is_never_0_or_1():
    scores = confidences(detections(*["car"] * 5, returns=[1, 3, 4, 30, 10**6]))
    assert scores[1] == 0.5
    assert np.all(np.diff(scores) > 0)
    assert 0 < scores[0] < scores[-1] < 1


def test_a_detectors_own_scores_count():
    given_scores = np.array([0.2, 0.9, 0.9])
    found = result_boxes(
        shot(Frame(0, 0, 0, 0)),
        detections("car", "bus", "truck", scores=given_scores),
        np.zeros((3, 2)),
    )
    assert [(box["detection_name"], box["detection_score"]) for box in found] == [
        ("bus", 0.9),
        ("truck", 0.9),
        ("car", 0.2),
    ]


def test_a_sample_holds_at_most_the_500_surest():
    scores = np.random.default_rng(0).permutation(np.linspace(0.0, 1.0, MOST_BOXES + 7))
    found = result_boxes(
        shot(Frame(0, 0, 0, 0)),
        detections(*["car"] * len(scores), scores=scores),
        np.zeros((len(scores), 2)),
    )
    assert len(found) == 500
    assert [box["detection_score"] for box in found] == sorted(scores, reverse=True)[:500]


def test_boxes_are_plain_json_and_none_are_none():
    found = result_boxes(
        shot(Frame(1, 2, 3, 4, 0.1, 0.2)), detections("car", "bicycle"), np.ones((2, 2))
    )
    assert json.loads(json.dumps(found)) == found
    assert result_boxes(shot(Frame(0, 0, 0, 0)), detections(), np.empty((0, 2))) == []
