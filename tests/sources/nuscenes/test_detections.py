import json

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES, Detections, Ego, ImageDetections
from care_sim.loops.film import Shot
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud, IdentifiedDetections
from care_sim.sources.nuscenes.detections import MOST_BOXES, DetectionFile, attribute, result_boxes
from care_sim.sources.nuscenes.films import nuscenes_film
from care_sim.sources.nuscenes.recordings import split_scenes
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import SENSORS
from tests.helpers.nuscenes_drive import KEYFRAMES, OBJECTS, SPLIT, write_drive
from tests.helpers.nuscenes_scene import SCENE, database, first


def picture(channel):
    return f"{SCENE}-0-{channel}"


def whole_box(root):
    """The projected box of CAR in the front picture, in recorded pixels, and its film."""
    movie = first(root)
    shot = movie.shots[0]
    front = movie.cameras[0]
    _, _, (_, u, v) = SENSORS["CAM_FRONT"]
    shift = np.tile(np.array([front.width, front.height]) / 2 - (u, v), 2)
    return (shot.seen.detections.boxes[0] - shift).tolist(), shot


def forms(box):
    left, top, right, bottom = box
    token = picture("CAM_FRONT")
    file = f"samples/CAM_FRONT/{SCENE}-0.jpg"
    coco = {"bbox": [left, top, right - left, bottom - top], "category_id": 3, "score": 0.6}
    own = {"bbox_corners": box, "category_name": "vehicle.car", "score": 0.6}
    named = {"bbox_corners": box, "detection_name": "car", "detection_score": 0.6}
    return {
        "rows": [own | {"sample_data_token": token}],
        "results": {"meta": {}, "results": {token: [named]}},
        "coco": [coco | {"image_id": token}, coco | {"image_id": token, "category_id": 4}],
        "coco by file": [coco | {"image_id": file}],
    }


@pytest.mark.parametrize("form", ["rows", "results", "coco", "coco by file"])
def test_detections_come_from_a_file_in_either_form(tmp_path, form):
    root = database(tmp_path)
    box, shot = whole_box(root)
    path = tmp_path / "found.json"
    path.write_text(json.dumps(forms(box)[form]))
    film = first(root, detections=DetectionFile(path))
    (detected,) = film.shots
    assert film.detected
    found = detected.seen.detections
    assert found.confidences.tolist() == [0.6]
    assert found.boxes[0] == pytest.approx(shot.seen.detections.boxes[0])
    assert detected.seen.objects.tolist() == [0]


def test_a_detection_elsewhere_or_of_another_class_lies_on_nobody(tmp_path):
    root = database(tmp_path)
    (left, top, right, bottom), _ = whole_box(root)
    token = picture("CAM_FRONT")
    beside, here = [left + 300, top, right + 300, bottom], [left, top, right, bottom]
    rows = [
        {"sample_data_token": token, "bbox_corners": box, "category_name": name, "score": 1}
        for box, name in [(beside, "car"), (here, "truck")]
    ]
    path = tmp_path / "found.json"
    path.write_text(json.dumps(rows))
    (shot,) = first(root, detections=DetectionFile(path)).shots
    assert shot.seen.objects.tolist() == [NO_OBJECT, NO_OBJECT]


COCO = {"image_id": "t", "bbox": [0, 0, 5, 5], "category_id": 3, "score": 1}
OWN = {"sample_data_token": "t", "bbox_corners": [0, 0, 5, 5], "category_name": "car", "score": 1}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ({"sample_data_token": "t"}, "it lacks 'bbox_corners'"),
        (COCO | {"bbox": [0, 0, 1]}, r"no box of four numbers: \[0, 0, 1\]"),
        (COCO | {"bbox": [0, 0, -5, 5]}, "a box without width or height"),
        (COCO | {"bbox": [0, 0, 5, 1e308]}, r"a box beyond 100000 pixels: \[0, 0, 5, 1e\+308\]"),
        (OWN | {"bbox_corners": [-2e5, 0, 5, 5]}, "a box beyond 100000 pixels"),
        (COCO | {"bbox": "0055"}, "no box of four numbers: '0055'"),
        (
            COCO | {"category_id": 0},
            "category_id 0 is none of the categories coco: 1 person, 2",
        ),
        (
            COCO | {"category_id": 91},
            "category_id 91 is none of the categories coco: 1 person, 2",
        ),
        (OWN | {"bbox_corners": [0, 0, 5, float("nan")]}, "no box of four numbers"),
        (
            OWN | {"category_name": "vehicle.carr"},
            "unknown category 'vehicle.carr'; the nearest is vehicle.car; known: animal, ",
        ),
        (OWN | {"score": 87}, r"score must lie in \[0, 1\], got 87"),
        (OWN | {"score": "0.5"}, r"score must lie in \[0, 1\], got '0.5'"),
        (OWN | {"sample_data_token": None}, "no token of a picture: None"),
        (3, "no map of fields: 3"),
    ],
)
def test_a_detection_that_cannot_be_read_is_named(tmp_path, row, reason):
    path = tmp_path / "found.json"
    path.write_text(json.dumps([OWN, row]))
    with pytest.raises(InvalidInput, match=rf"found.json: detection 1 cannot be read \({reason}"):
        DetectionFile(path)


def test_a_detection_on_no_picture_of_the_database_is_named(tmp_path):
    path = tmp_path / "found.json"
    path.write_text(json.dumps([OWN | {"sample_data_token": "nowhere"}]))
    with pytest.raises(
        InvalidInput,
        match=r"found.json: a detection on 'nowhere', which is no keyframe of .*sample_data.json",
    ):
        first(database(tmp_path), detections=DetectionFile(path))


NOTHING = np.empty(0, np.int64)
BOX = [10.0, 2.0, -1.0, 4.6, 1.9, 1.7, 0.3]


def shot_of(sensor):
    nobody = Annotations(NOTHING, NOTHING, np.empty((0, 7)))
    identified = IdentifiedDetections(ImageDetections.from_rows(np.empty((0, 9))), NOTHING)
    return Shot(
        0.0, "sample", sensor, Ego(), nobody, identified, Cloud(NOTHING, np.empty((0, 3)), NOTHING)
    )


def detections(*names, box=BOX, returns=None, scores=None):
    classes = np.array([CLASSES.index(name) for name in names], dtype=np.int64)
    counts = np.full(len(names), 5) if returns is None else np.array(returns)
    return Detections(classes, np.tile(box, (len(names), 1)), counts, scores)


def test_a_box_has_the_place_heading_and_velocity_of_the_world_and_its_width_first():
    sensor = Frame(100.0, 50.0, 1.84, np.pi / 2)
    (found,) = result_boxes(shot_of(sensor), detections("car"), np.array([[3.0, 0.0]]))
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
    found = result_boxes(shot_of(Frame(0, 0, 0, 1.0)), detections(name, name), velocities)
    assert [box["attribute_name"] for box in found] == [standing, moving]


def test_a_detectors_own_scores_count():
    given_scores = np.array([0.2, 0.9, 0.9])
    found = result_boxes(
        shot_of(Frame(0, 0, 0, 0)),
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
        shot_of(Frame(0, 0, 0, 0)),
        detections(*["car"] * len(scores), scores=scores),
        np.zeros((len(scores), 2)),
    )
    assert len(found) == 500
    assert [box["detection_score"] for box in found] == sorted(scores, reverse=True)[:500]
