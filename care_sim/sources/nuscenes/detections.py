"""Detections of a 2D detector that somebody ran on the pictures, from a file.

Two forms. nuScenes: rows with `sample_data_token`, `bbox_corners` (left, top, right, bottom),
`category_name` or `detection_name`, and `score` or `detection_score`, as a list or as a map
`results` from tokens to lists. COCO results: rows with `image_id`, `bbox` (left, top, width,
height), `category_id` and `score`; `image_id` is the token of the picture or its file name. Known
categories outside the five classes are left out.
"""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from care_sim.base.checks import check_number, check_whole
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.sensors.annotated import NO_OBJECT, Annotations, IdentifiedDetections
from care_sim.sources.nuscenes.cameras import RecordedCamera, projected
from care_sim.sources.nuscenes.categories import class_of
from care_sim.sources.nuscenes.table_files import JsonRow, read_json
from care_sim.sources.nuscenes.tables import Database

COCO = {1: "pedestrian", 2: "bicycle", 3: "car", 6: "bus", 8: "truck"}
"""The categories of COCO that the five classes hold."""
COCO_LAST = 90
"""The categories of COCO are numbered from 1 to this."""
FARTHEST_PX = 1e5
"""How far a box may reach, within the picture or beside it, so that its area stays a number."""
SAME_OBJECT_IOU = 0.5
"""A detection lies on the object of its class whose projected box overlaps it at least this much
(PASCAL VOC).
"""

Found = tuple[int, float, Floats]
"""Class, confidence and box (4,) in the recorded picture."""


class DetectionFile:
    """The detections of a file, by the token or the file name of their picture."""

    def __init__(self, path: Path):
        self.path = path
        self.pictures: dict[str, list[Found]] = defaultdict(list)
        for number, row in enumerate(_rows(path)):
            try:
                picture, detection = _read(row)
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


def _rows(path: Path) -> list[JsonRow]:
    """The rows of either form, which may be none."""
    content = read_json(path)
    results = content.get("results") if isinstance(content, dict) else None
    if isinstance(results, dict) and all(isinstance(rows, list) for rows in results.values()):
        # Rows of the map do not repeat their token. What is no row stays, and is refused with its
        # number.
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


def _read(row: JsonRow) -> tuple[str, Found | None]:
    """The picture and the detection on it, None outside the five classes."""
    if not isinstance(row, dict):
        raise TypeError(f"no map of fields: {row!r}")
    if "image_id" in row:
        left, top, width, height = _box(row["bbox"])
        label = _coco_class(row["category_id"])
        corners = np.array([left, top, left + width, top + height])
        picture = str(row["image_id"])
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


def _coco_class(number: object) -> str | None:
    check_whole("category_id", number, 1, COCO_LAST)
    return COCO.get(cast(int, number))


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
