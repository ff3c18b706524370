"""Detections of a 2D detector that somebody ran on the pictures, from a file.

Two forms. nuScenes: rows with `sample_data_token`, `bbox_corners` (left, top, right, bottom), `category_name` or
`detection_name`, and `score` or `detection_score`, as a list or as a map `results` from tokens to lists. COCO results:
rows with `image_id`, `bbox` (left, top, width, height), `category_id` and `score`; `image_id` is the token of the
picture or its file name. Categories outside the five classes are left out.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from care_sim.errors import InvalidInput
from care_sim.film import NOBODY, Annotations, Sights
from care_sim.frames import Floats
from care_sim.grid import Cells
from care_sim.sources.nuscenes.cameras import RecordedCamera, projected
from care_sim.sources.nuscenes.categories import class_of
from care_sim.sources.nuscenes.tables import Row, read_json
from care_sim.types import CLASSES, ImageDetections

COCO = {1: "pedestrian", 2: "bicycle", 3: "car", 6: "bus", 8: "truck"}
"""The categories of COCO that the five classes hold."""
SAME_OBJECT_IOU = 0.5
"""A detection lies on the object of its class whose projected box overlaps it at least this much (PASCAL VOC)."""

Found = tuple[int, float, Floats]
"""Class, confidence and box (4,) in the recorded picture."""


class DetectionFile:
    """The detections of a file, by the token or the file name of their picture."""

    def __init__(self, path: Path):
        self._found: dict[str, list[Found]] = defaultdict(list)
        for number, row in enumerate(_rows(read_json(path))):
            try:
                picture, detection = _read(row)
            except (KeyError, TypeError, ValueError) as error:
                raise InvalidInput(f"{path}: detection {number} cannot be read ({error!r})") from error
            if detection is not None:
                self._found[picture].append(detection)

    def sights(self, cameras: Sequence[RecordedCamera], pictures: Sequence[Row], annotations: Annotations) -> Sights:
        """The detections on the pictures of a keyframe, one a camera, each with the object that it lies on."""
        rows, objects = [np.empty((0, len(ImageDetections.COLUMNS)))], [np.empty(0, np.int64)]
        for number, (camera, picture) in enumerate(zip(cameras, pictures, strict=True)):
            found = self._found.get(picture["token"], []) + self._found.get(picture["filename"], [])
            boxes = np.array([box for _, _, box in found]).reshape(-1, 4) + camera.shift
            classes = np.array([label for label, _, _ in found], dtype=np.int64)
            zeros = np.zeros(len(found))
            rows.append(np.column_stack([classes, [c for _, c, _ in found], boxes, zeros + number, zeros, zeros]))
            objects.append(_behind(boxes, classes, projected(camera, annotations.boxes), annotations))
        return Sights(ImageDetections.from_rows(np.concatenate(rows)), np.concatenate(objects))


def _rows(content: object) -> list[Row]:
    if isinstance(content, Mapping) and "results" in content:
        results: Mapping[str, list[Row]] = content["results"]
        return [{"sample_data_token": token, **row} for token, rows in results.items() for row in rows]
    return list(content) if isinstance(content, list) else [{}]


def _read(row: Row) -> tuple[str, Found | None]:
    if "image_id" in row:
        left, top, width, height = row["bbox"]
        label, box = COCO.get(row["category_id"]), [left, top, left + width, top + height]
        picture, score = str(row["image_id"]), row["score"]
    else:
        picture, box = row["sample_data_token"], row["bbox_corners"]
        label = class_of(row["category_name"] if "category_name" in row else row["detection_name"])
        score = row["score"] if "score" in row else row["detection_score"]
    corners = np.array(box, dtype=float)
    if corners.shape != (4,) or not np.isfinite([*corners, float(score)]).all() or (corners[2:] <= corners[:2]).any():
        raise ValueError(f"no box: {box}")
    return picture, None if label is None else (CLASSES.index(label), float(score), corners)


def _behind(boxes: Floats, classes: Cells, shown: Floats, annotations: Annotations) -> Cells:
    """(n,) the object behind each detected box, NOBODY where no projected box (m, 4) overlaps it enough."""
    if not len(boxes) or not len(shown):
        return np.full(len(boxes), NOBODY, np.int64)
    low, high = np.maximum(boxes[:, None, :2], shown[:, :2]), np.minimum(boxes[:, None, 2:], shown[:, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas, others = (np.prod(b[:, 2:] - b[:, :2], axis=1) for b in (boxes, shown))
    overlap = np.where(classes[:, None] == annotations.classes, common / (areas[:, None] + others - common), 0.0)
    best = overlap.argmax(axis=1)
    return np.where(overlap.max(axis=1) >= SAME_OBJECT_IOU, annotations.objects[best], NOBODY)
