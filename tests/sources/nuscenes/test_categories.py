"""Numbered pictures and categories of files of 2D detectors."""

import json

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.sources.nuscenes.categories import CATEGORY_MAPS, Categories
from care_sim.sources.nuscenes.detections import DetectionFile

IMAGES = [{"id": 7, "file_name": "samples/CAM_FRONT/seven.jpg"}]


def row(**told):
    return {"image_id": 7, "bbox": [1, 2, 3, 4], "category_id": 1, "score": 0.5} | told


def read(tmp_path, content):
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps(content))
    return DetectionFile(path).pictures


@pytest.mark.parametrize(
    ("categories", "number", "name"),
    [
        ("coco", 8, "truck"),
        ("coco80", 7, "truck"),
        ("nuimages", 7, "pedestrian"),
        ("bdd100k", 8, "bicycle"),
        ([{"id": 3, "name": "Person"}], 3, "pedestrian"),
        ([{"id": 0, "name": "human.pedestrian.child"}], 0, "pedestrian"),
        ("bdd100k", 2, None),
        ("nuimages", 2, None),
    ],
)
def test_a_category_is_known_by_its_number(tmp_path, categories, number, name):
    content = {
        "annotations": [row(category_id=number)], "images": IMAGES, "categories": categories
    }  # fmt: skip
    found = read(tmp_path, content)["samples/CAM_FRONT/seven.jpg"] if name else []
    assert [CLASSES[label] for label, *_ in found] == [name] * bool(name)
    assert name or not read(tmp_path, content)


@pytest.mark.parametrize("name", CATEGORY_MAPS)
def test_every_map_holds_each_of_the_five_classes_once(name):
    found = [Categories(name).class_of(number) for number in CATEGORY_MAPS[name]]
    assert sorted(filter(None, found)) == sorted(CLASSES)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ({"annotations": [row(category_id=11)], "images": IMAGES, "categories": "bdd100k"},
         "11 is none of the categories bdd100k: 1 pedestrian, 2 rider, 3 car"),
        ({"annotations": [row()], "categories": "kitti"}, "unknown map of categories 'kitti'"),
        ({"annotations": [row()], "categories": [{"id": 1}]}, "must be a list of id and name"),
        ({"annotations": [row()], "categories": [{"id": 1, "name": "Fussgaenger"}]},
         "categories must name one of car, truck"),
        ({"annotations": [row()], "images": [{"id": 7}]}, "images must be rows with id"),
        ([row()], "image_id 7 is none of the 0 images told"),
    ],
)  # fmt: skip
def test_numbers_that_nobody_told_are_named(tmp_path, content, fault):
    with pytest.raises(InvalidInput, match=fault):
        read(tmp_path, content)
