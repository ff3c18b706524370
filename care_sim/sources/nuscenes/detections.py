"""Detections from a file of a 2D detector that somebody ran on the pictures, and detections in the
results form of the nuScenes detection task, which the official devkit scores.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.forgetting import ForgettingRules
from care_sim.core.frames import turned
from care_sim.core.types import CLASSES, Detections, ImageDetections
from care_sim.loops.film import Shot
from care_sim.sensors.annotated import NO_OBJECT, Annotations, IdentifiedDetections
from care_sim.sources.film_checks import report_once
from care_sim.sources.nuscenes.cameras import (
    RecordedCamera,
    projected,
)
from care_sim.sources.nuscenes.categories import Categories, class_of
from care_sim.sources.nuscenes.table_files import JsonRow, read_json
from care_sim.sources.nuscenes.tables import Database

FARTHEST_PX = 1e5
"""Largest coordinate of a box, so that its area stays finite."""
SAME_OBJECT_IOU = 0.5
"""A detection lies on the object of its class whose projected box overlaps it at least this much
(PASCAL VOC).
"""

Found = tuple[int, float, Floats]
"""Class, confidence and box (4,) in the recorded picture."""


class DetectionFile:
    """The detections of a file, by the token or the file name of their picture.

    There are two forms. nuScenes: a list of rows, or a map `results` from tokens to lists. Rows
    have `sample_data_token`, `bbox_corners` (left, top, right, bottom), `category_name` or
    `detection_name`, and `score` or `detection_score`. COCO results: rows with `image_id`, `bbox`
    (left, top, width, height), `category_id` and `score`; `image_id` is the token of the picture or
    its file name.

    For numbered pictures and categories, use a map with three entries. `annotations` are the COCO
    rows, `images` rows with `id` and `file_name`. `categories` is a name of
    `care_sim.sources.nuscenes.categories.CATEGORY_MAPS`, or rows with `id` and `name`. Known
    categories outside the five classes are left out.
    """

    def __init__(self, path: Path):
        self.path = path
        self.pictures: dict[str, list[Found]] = defaultdict(list)
        rows, images, categories = _parts(path)
        for number, row in enumerate(rows):
            try:
                picture, detection = _read(row, images, categories)
            except KeyError as error:
                raise InvalidInput(
                    f"{path}: detection {number} cannot be read (it lacks {error})"
                ) from error
            except (TypeError, ValueError) as error:
                raise InvalidInput(
                    f"{path}: detection {number} cannot be read ({error})"
                ) from error
            if detection is not None:
                self.pictures[picture].append(detection)

    def check(self, database: Database) -> None:
        """Raise InvalidInput for a detection whose picture is no keyframe of the database."""
        for picture in self.pictures:
            if picture not in database.pictures:
                table = database.path("sample_data")
                raise InvalidInput(
                    f"{self.path}: a detection on {picture!r}, which is no keyframe of {table}"
                )

    def seen(
        self,
        cameras: Sequence[RecordedCamera],
        pictures: Sequence[tuple[JsonRow, Floats]],
        annotations: Annotations,
    ) -> IdentifiedDetections:
        """The detections on the pictures of a keyframe, one picture per camera, each with the
        object that it lies on. A picture is its recording and the boxes (n, 7) of the annotated
        objects in the frame of the LiDAR when it was taken.
        """
        rows = [np.empty((0, len(ImageDetections.COLUMNS)))]
        objects = [np.empty(0, np.int64)]
        for number, (camera, (picture, own)) in enumerate(zip(cameras, pictures, strict=True)):
            # COCO names pictures by token or by file, so a picture may be known under both.
            found = self.pictures.get(picture["token"], []) + self.pictures.get(
                picture["filename"], []
            )
            boxes = np.array([box for _, _, box in found]).reshape(-1, 4) + camera.shift
            classes = np.array([label for label, _, _ in found], dtype=np.int64)
            zeros = np.zeros(len(found))
            rows.append(
                np.column_stack(
                    [classes, [c for _, c, _ in found], boxes, zeros + number, zeros, zeros]
                )
            )
            objects.append(objects_behind(boxes, classes, projected(camera, own), annotations))
        return IdentifiedDetections(
            ImageDetections.from_rows(np.concatenate(rows)), np.concatenate(objects)
        )


def _parts(path: Path) -> tuple[list[JsonRow], dict[int, str], Categories]:
    """The rows, the file names of numbered pictures, and the categories."""
    content = read_json(path)
    if not isinstance(content, dict) or "annotations" not in content:
        return _rows(path, content), {}, Categories()
    try:
        categories = Categories(content.get("categories", "coco"))
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    try:
        images = {int(image["id"]): str(image["file_name"]) for image in content.get("images", ())}
    except (KeyError, TypeError, ValueError) as error:
        told = f"images must be rows with id and file_name ({error})"
        raise InvalidInput(f"{path}: {told}") from error
    if categories.left_out:
        report_once(f"{path}: categories left out: {', '.join(categories.left_out)}")
    return _rows(path, content["annotations"]), images, categories


def _rows(path: Path, content: Any) -> list[JsonRow]:
    """The rows of either form, which may be none."""
    results = content.get("results") if isinstance(content, dict) else None
    if isinstance(results, dict) and all(isinstance(rows, list) for rows in results.values()):
        # Rows of the map do not repeat their token. An entry that is no row stays, and is refused
        # with its number.
        pairs = [(token, row) for token, rows in results.items() for row in rows]
        return [
            {"sample_data_token": token, **row} if isinstance(row, dict) else row
            for token, row in pairs
        ]
    if not isinstance(content, list):
        raise InvalidInput(
            f"{path}: must hold a list of detections, or a map `results` from tokens to such lists"
        )
    return content


def _read(
    row: JsonRow, images: Mapping[int, str], categories: Categories
) -> tuple[str, Found | None]:
    """The picture and the detection on it, None outside the five classes."""
    if not isinstance(row, dict):
        raise TypeError(f"no map of fields: {row!r}")
    if "image_id" in row:
        left, top, width, height = _box(row["bbox"])
        label = categories.class_of(row["category_id"])
        corners = np.array([left, top, left + width, top + height])
        picture = row["image_id"]
        if isinstance(picture, int):
            if picture not in images:
                raise ValueError(f"image_id {picture} is none of the {len(images)} images told")
            picture = images[picture]
        score = row["score"]
    else:
        picture = row["sample_data_token"]
        corners = _box(row["bbox_corners"])
        label = class_of(row["category_name"] if "category_name" in row else row["detection_name"])
        score = row["score"] if "score" in row else row["detection_score"]
    if not isinstance(picture, str):
        raise TypeError(f"no token of a picture: {picture!r}")
    if (corners[2:] <= corners[:2]).any():
        raise ValueError(f"a box without width or height: {corners.tolist()}")
    check_number("score", score, 0, 1)
    return picture, None if label is None else (CLASSES.index(label), float(score), corners)


def _box(numbers: object) -> Floats:
    box = np.array(numbers)
    if box.shape != (4,) or box.dtype.kind not in "if" or not np.isfinite(box).all():
        raise ValueError(f"no box of four numbers: {numbers!r}")
    if np.abs(box).max() > FARTHEST_PX:
        raise ValueError(f"a box beyond {FARTHEST_PX:g} pixels: {numbers!r}")
    return box.astype(float)


def objects_behind(
    boxes: Floats, classes: Integers, shown: Floats, annotations: Annotations
) -> Integers:
    """(n,) the object behind each detected box, NO_OBJECT where no projected box (m, 4) overlaps it
    enough.
    """
    if not len(boxes) or not len(shown):
        return np.full(len(boxes), NO_OBJECT, np.int64)
    # Intersection over union of every detection (n) with every projected box (m).
    low = np.maximum(boxes[:, None, :2], shown[:, :2])
    high = np.minimum(boxes[:, None, 2:], shown[:, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas, others = (np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, shown))
    overlap = np.where(
        classes[:, None] == annotations.classes, common / (areas[:, None] + others - common), 0.0
    )
    best = overlap.argmax(axis=1)
    return np.where(overlap.max(axis=1) >= SAME_OBJECT_IOU, annotations.objects[best], NO_OBJECT)


MODALITIES = {
    "use_camera": True,
    "use_lidar": True,
    "use_radar": False,
    "use_map": False,
    "use_external": False,
}
"""Required `meta` of the form. The camera decides where a policy looks, and the LiDAR measures the
boxes.
"""
MOST_BOXES = 500
"""A sample with more is refused."""
STANDING_MPS = ForgettingRules.static_mps
"""Up to this speed nothing moves: the paper's tau_static."""
_VEHICLE = ("vehicle.parked", "vehicle.moving")
ATTRIBUTES = {
    "car": _VEHICLE,
    "truck": _VEHICLE,
    "bus": _VEHICLE,
    "bicycle": ("cycle.without_rider", "cycle.with_rider"),
    "pedestrian": ("pedestrian.standing", "pedestrian.moving"),
}
"""The attribute of what stands, and of what moves. A bicycle that moves is ridden. Two of the eight
official attributes are left out, a vehicle that only stopped and a person who sits: a box and its
speed cannot tell them.
"""


def result_boxes(shot: Shot, detections: Detections, velocities: Floats) -> list[JsonRow]:
    """The detections (n) of a keyframe as boxes of its sample, surest first, the MOST_BOXES surest
    of more.

    The form is that of
    https://github.com/nutonomy/nuscenes-devkit/blob/master/python-sdk/nuscenes/eval/detection/README.md
    `velocities` (n, 2) m/s over ground, in sensor axes. In the form, places, headings and
    velocities are those of the world, sizes are width, length and height, and a rotation is a
    quaternion w, x, y, z.
    """
    scores = confidences(detections)
    # Stable: of equal scores the earlier one stays, on every machine.
    order = np.argsort(-scores, kind="stable")[:MOST_BOXES]
    world = shot.sensor.boxes_to_world(detections.boxes)
    moves = turned(velocities, shot.sensor.yaw)
    told = detections.attributes or [""] * len(detections)
    return [
        {"sample_token": shot.token}
        | _result_box(
            CLASSES[detections.classes[row]], world[row], moves[row], float(scores[row]), told[row]
        )
        for row in order.tolist()
    ]


def confidences(detections: Detections) -> Floats:
    """(n,) the detector's own scores. For a detector without scores n / (n + MIN_RETURNS) of n
    returns: a half if an object just counts, towards 1 with more returns. It is never 0, which the
    devkit reads as a recall that was not reached.
    """
    if detections.scores is not None:
        return detections.scores
    scores: Floats = detections.returns / (detections.returns + MIN_RETURNS)
    return scores


def attribute(name: str, speed_mps: float, told: str = "") -> str:
    """The official attribute: the one that the detector `told`, where its class may have it, else
    that of the class at a speed over ground.
    """
    standing, moving = ATTRIBUTES[name]
    if told.partition(".")[0] == standing.partition(".")[0]:
        return told
    return moving if speed_mps > STANDING_MPS else standing


def _result_box(name: str, box: Floats, velocity: Floats, score: float, told: str) -> JsonRow:
    x, y, z, length, width, height, yaw = box.tolist()
    return {
        "translation": [x, y, z],
        "size": [width, length, height],
        # A turn by yaw about z.
        "rotation": [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))],
        "velocity": velocity.tolist(),
        "detection_name": name,
        "detection_score": score,
        "attribute_name": attribute(name, float(np.hypot(*velocity)), told),
    }
