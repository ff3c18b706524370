import json

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.nuscenes.detections import DetectionFile
from tests.helpers.nuscenes_database import SENSORS
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
        (COCO | {"category_id": 0}, "category_id must be a whole number >= 1 and <= 90, got 0"),
        (COCO | {"category_id": 91}, "category_id must be a whole number >= 1 and <= 90, got 91"),
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


@pytest.mark.parametrize(
    "content", [{"annotations": 3}, {"results": 3}, {"results": {"t": 3}}, None, "x"]
)
def test_a_file_without_detections_is_named(tmp_path, content):
    path = tmp_path / "found.json"
    path.write_text(json.dumps(content))
    with pytest.raises(
        InvalidInput, match=r"found.json: must hold a list of detections, or a map `results`"
    ):
        DetectionFile(path)


def test_a_detection_on_no_picture_of_the_database_is_named(tmp_path):
    path = tmp_path / "found.json"
    path.write_text(json.dumps([OWN | {"sample_data_token": "nowhere"}]))
    with pytest.raises(
        InvalidInput,
        match=r"found.json: a detection on 'nowhere', which is no keyframe of .*sample_data.json",
    ):
        first(database(tmp_path), detections=DetectionFile(path))
