"""The detector `recorded`: what another one reported of full scans, played back."""

import json

import numpy as np
import pytest

from care_sim import film_of_boxes
from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.sensors.annotated import NO_ANNOTATIONS, Cloud

HEIGHT = 1.84
SENSOR = Frame(100.0, 50.0, HEIGHT, np.pi / 2)
"""The car looks along the y axis of the world."""
CAR = {
    "translation": [100.0, 60.0, 1.0],
    "size": [2.0, 4.0, 1.6],
    "rotation": [float(np.cos(np.pi / 4)), 0.0, 0.0, float(np.sin(np.pi / 4))],
    "velocity": [0.0, 3.0],
    "detection_name": "car",
    "detection_score": 0.8,
    "attribute_name": "vehicle.moving",
}
"""10 m ahead, driving on."""
ON_IT = Cloud(np.array([3]), np.array([[8.1, 0.0, -0.5]]), np.array([7]))
BESIDE = Cloud(np.array([3]), np.array([[8.1, 4.0, -0.5]]), np.array([7]))


def file_of(tmp_path, *boxes):
    path = tmp_path / "results.json"
    path.write_text(json.dumps({"meta": {}, "results": {"here": list(boxes)}}))
    return path


def played(path, cloud, **parameters):
    detector = make_detector("recorded", HEIGHT, file=path, **parameters)
    detector.at("here", SENSOR)
    return detector.detect(cloud, NO_ANNOTATIONS)


def test_a_reported_box_counts_where_it_was_fired_at(tmp_path):
    path = file_of(tmp_path, CAR, CAR | {"detection_name": "barrier"})
    found, objects = played(path, ON_IT)
    assert [CLASSES[label] for label in found.classes] == ["car"]
    assert found.boxes[0] == pytest.approx([10.0, 0.0, 1.0 - HEIGHT, 4.0, 2.0, 1.6, 0.0])
    assert found.velocities[0] == pytest.approx([3.0, 0.0])
    assert (found.scores.tolist(), found.attributes) == ([0.8], ["vehicle.moving"])
    assert (found.returns.tolist(), objects.tolist()) == ([1], [7])
    missed, _ = played(path, BESIDE)
    assert len(missed) == 0
    few, _ = played(path, ON_IT, least_returns=2)
    assert len(few) == 0


@pytest.mark.parametrize(
    ("box", "fault"),
    [
        ({"size": [2.0, 4.0]}, "box 0 of 'here' cannot be read"),
        ({"size": [2.0, -4.0, 1.0]}, "sizes must be above 0"),
        ({"detection_score": 3}, "scores from 0 to 1"),
        ({"translation": [1e30, 0, 0]}, "not the numbers of a box"),
    ],
)
def test_a_box_that_is_none_is_named(tmp_path, box, fault):
    with pytest.raises(InvalidInput, match=fault):
        played(file_of(tmp_path, CAR | box), ON_IT)


def test_keyframes_that_nobody_recorded_are_named(tmp_path):
    detector = make_detector("recorded", HEIGHT, file=file_of(tmp_path))
    with pytest.raises(InvalidInput, match="has no results of the closed loop"):
        detector.detect(ON_IT, NO_ANNOTATIONS)
    with pytest.raises(InvalidInput, match="has no results of the keyframe 'there'"):
        detector.at("there", SENSOR)


def test_a_file_of_something_else_is_named(tmp_path):
    path = tmp_path / "list.json"
    path.write_text("[]")
    with pytest.raises(InvalidInput, match=r"list.json: must hold a map `results`"):
        make_detector("recorded", HEIGHT, file=path)
    with pytest.raises(InvalidInput, match="cannot be read"):
        make_detector("recorded", HEIGHT, file=tmp_path / "none.json")


HEAD = "keyframe,class,x,y,z,length,width,height,yaw,score"
ROW = "here,car,10,0,-0.8,4,2,1.6,0.1,0.7"


def table_of(tmp_path, *lines):
    path = tmp_path / "results.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_table_holds_boxes_in_the_frame_of_the_lidar(tmp_path):
    path = table_of(tmp_path, HEAD, ROW, "there,,,,,,,,,", "here,bus,30,9,0,10,3,3,0,1")
    found, objects = played(path, ON_IT)
    assert [CLASSES[label] for label in found.classes] == ["car"]
    assert found.boxes.tolist() == [[10.0, 0.0, -0.8, 4.0, 2.0, 1.6, 0.1]]
    assert (found.scores.tolist(), found.returns.tolist(), objects.tolist()) == ([0.7], [1], [7])
    assert found.velocities is None
    assert len(played(path, BESIDE)[0]) == 0
    detector = make_detector("recorded", HEIGHT, file=path)
    detector.at("there", SENSOR)
    assert len(detector.detect(ON_IT, NO_ANNOTATIONS)[0]) == 0
    with pytest.raises(InvalidInput, match="has no results of the keyframe 'elsewhere'"):
        detector.at("elsewhere", SENSOR)


@pytest.mark.parametrize("token", ["001", "2026-01-01 00:00:00.5"])
def test_a_keyframe_may_look_like_a_number_or_a_time(tmp_path, token):
    path = table_of(tmp_path, HEAD, ROW.replace("here", token))
    detector = make_detector("recorded", HEIGHT, file=path)
    detector.at(token, SENSOR)
    assert len(detector.detect(ON_IT, NO_ANNOTATIONS)[0]) == 1


def test_a_table_plays_a_film_of_boxes(tmp_path):
    """The reports are the true boxes, so whatever returns is detected where it stands."""
    poses = [[100 + 4.0 * k, 50.0, 10.0, 0.3] for k in range(4)]
    van = {"id": "van", "class": "truck", "size": [6.0, 2.2, 2.6], "pose": [118.0, 58.0, 11.3, 1]}
    film = film_of_boxes("monday", [1.7e9 + 0.5 * k for k in range(4)], poses, [[van]] * 4)
    rows = [
        ",".join(map(str, [shot.token, "truck", *shot.annotations.boxes[0].tolist(), 0.9]))
        for shot in film.shots
    ]
    assert [shot.token for shot in film.shots] == [f"monday/{k}" for k in range(4)]
    detector = make_detector("recorded", film.sensor_height_m, file=table_of(tmp_path, HEAD, *rows))
    for shot in film.shots:
        detector.at(shot.token, shot.sensor)
        found, objects = detector.detect(shot.cloud, shot.annotations)
        assert found.boxes == pytest.approx(shot.annotations.boxes)
        assert objects.tolist() == [0]


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        ([HEAD.replace("score", "sure"), ROW], "must have one column score, has keyframe, class"),
        ([HEAD, ROW.replace("car", "Car")], "unknown class in line 2 of .*'Car'; the nearest is"),
        ([HEAD, ROW, ROW.replace("0.1", "90")], "results.csv, line 3: .* radians within a full tu"),
        ([HEAD, ROW.replace("0.7", "70")], "a score from 0 to 1, got"),
        ([HEAD, ROW.replace("1.6", "0")], "sizes above 0"),
        ([HEAD, ROW.replace(",10,", ",,")], "must be metres"),
        ([HEAD, ROW.replace(",10,", ",near,")], "the column x must hold numbers"),
        ([HEAD, ROW.replace("here", "")], "results.csv, line 2: a row must name its keyframe"),
    ],
)
def test_a_wrong_row_of_a_table_is_named_in_one_line(tmp_path, lines, fault):
    with pytest.raises(InvalidInput, match=fault) as refused:
        make_detector("recorded", HEIGHT, file=table_of(tmp_path, *lines))
    assert "\n" not in str(refused.value)
