"""Recorded results of a real detector on full scans: an upper bound of its results on a policy's
scans.
"""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.checks import check_known, check_number, check_path, check_whole
from care_sim.base.digests import Stamp, file_stamp
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.files import parsed_json
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import FULL_TURN, Frame
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.points_only import ATTRIBUTES, Detector, inside, objects_behind
from care_sim.sensors.annotated import Annotations, Cloud

BOX = ("x", "y", "z", "length", "width", "height", "yaw", "score")
COLUMNS = ("keyframe", "class", *BOX)
"""Columns of a CSV file of results."""
FARTHEST_M = 1e7
"""Largest coordinate of a map, metres."""
_MARGIN_M = 0.2
"""Reported boxes are off by a few centimetres, and returns lie on the surface of the object."""


class RecordedDetector(Detector):
    """Plays back a detector's results on full scans: an upper bound, not a detector.

    `file` holds results in the official form of the nuScenes detection task, whose samples are the
    keyframes of the film. A box counts if it holds `least_returns` of the policy's returns. The
    detector saw the full scan, so it might have missed the object with fewer. Boxes below
    `track_score` become no track.

    A file `.csv` serves every film: a row per box, with COLUMNS in metres and radians of the
    LiDAR's frame at the keyframe. That frame has x ahead, y left, z up, and its origin in the
    LiDAR. `keyframe` is the token of a `care_sim.loops.film.Shot`. A keyframe without boxes has a
    row with an empty class.
    """

    def __init__(
        self, file: str | os.PathLike[str], least_returns: int = 1, track_score: float = 0.0
    ):
        check_whole("least_returns", least_returns, 0)
        check_number("track_score", track_score, 0, 1)
        self.track_score = float(track_score)
        self._least_returns = least_returns
        check_path("file", file)
        self._file = Path(file)
        read = _csv_results if self._file.suffix == ".csv" else _results
        self._results: Mapping[str, Any] = read(self._file, file_stamp(self._file))
        self._here: tuple[str, Frame] | None = None

    def at(self, token: str | None, sensor: Frame) -> None:
        """See `Detector`. Raises InvalidInput for a keyframe that the file lacks."""
        if token is None:
            return
        if token not in self._results:
            raise InvalidInput(f"{self._file}: has no results of the keyframe {token!r}")
        self._here = token, sensor

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`. Raises InvalidInput in the closed loop,
        whose keyframes nobody recorded.
        """
        if self._here is None:
            raise InvalidInput(
                f"the detector recorded plays films: {self._file} has no results of the closed loop"
            )
        token, sensor = self._here
        cloud = cloud.whole
        reported = self._results[token]
        if not isinstance(reported, Detections):
            reported = _detections(self._file, token, reported, sensor)
        grown = reported.boxes.copy()
        grown[:, 3:6] += 2 * _MARGIN_M
        held = inside(cloud.points, grown).sum(axis=1)
        kept = held >= self._least_returns
        found = Detections(
            reported.classes,
            reported.boxes,
            held,
            reported.scores,
            reported.velocities,
            reported.attributes,
        ).take(kept)
        return found, objects_behind(grown[kept], cloud)


@lru_cache(maxsize=2)
def _results(path: Path, _stamp: Stamp) -> dict[str, list[Any]]:
    try:
        content = parsed_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: cannot be read ({error})") from error
    results = content.get("results") if isinstance(content, dict) else None
    if not isinstance(results, dict) or not all(isinstance(r, list) for r in results.values()):
        raise InvalidInput(
            f"{path}: must hold a map `results` from sample tokens to lists of boxes, the form of "
            "the nuScenes detection task"
        )
    return results


@lru_cache(maxsize=2)
def _csv_results(path: Path, _stamp: Stamp) -> dict[str, Detections]:
    """Return the boxes of every keyframe, in the sensor frame."""
    # Imported here because it loads PyArrow.
    from care_sim.perception.csv_tables import columns_of, read_csv, texts_of

    table = read_csv(path, texts=COLUMNS[:2])
    tokens, names = (texts_of(path, table, column) for column in COLUMNS[:2])
    numbers = columns_of(path, table, BOX)
    rows: dict[str, list[int]] = {}
    for number, (token, name) in enumerate(zip(tokens, names, strict=True)):
        if not token:
            raise InvalidInput(f"{path}, line {number + 2}: a row must name its keyframe")
        own = rows.setdefault(token, [])
        if not name:
            continue
        check_known(f"class in line {number + 2} of {path}", name, CLASSES)
        _check_box(f"{path}, line {number + 2}", numbers[number])
        own.append(number)
    return {
        token: Detections(
            np.array([CLASSES.index(names[row]) for row in own], np.int64),
            numbers[own, :7],
            np.zeros(len(own), np.int64),
            numbers[own, 7],
        )
        for token, own in rows.items()
    }


def _check_box(line: str, row: Floats) -> None:
    is_near = (np.abs(row[:6]) <= FARTHEST_M).all() and (row[3:6] > 0).all()
    if not (is_near and abs(row[6]) <= FULL_TURN and 0 <= row[7] <= 1):
        raise InvalidInput(
            f"{line}: must be metres with sizes above 0, a yaw in radians within a full turn and a "
            f"score from 0 to 1, got {shown(row.tolist())}"
        )


def _detections(path: Path, token: str, rows: list[Any], sensor: Frame) -> Detections:
    """Return the boxes of a sample in its sensor frame. Classes outside the five are left out."""
    kept, boxes, velocities = [], [], []
    for number, row in enumerate(rows):
        try:
            if row["detection_name"] not in CLASSES:
                continue
            width, length, height = row["size"]
            w, x, y, z = row["rotation"]
            yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            box = [*row["translation"], length, width, height, yaw]
            numbers = np.array([*box, row["detection_score"]], dtype=float)
            if numbers.shape != (8,) or not (np.abs(numbers) <= FARTHEST_M).all():
                raise ValueError("not the numbers of a box")
            velocity = np.array(row.get("velocity") or (np.nan, np.nan), dtype=float)
            if velocity.shape != (2,):
                raise ValueError("a velocity must be two numbers")
            if not (numbers[3:6] > 0).all() or not 0 <= numbers[7] <= 1:
                raise ValueError("sizes must be above 0 and scores from 0 to 1")
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInput(
                f"{path}: box {number} of {token!r} cannot be read ({error})"
            ) from error
        boxes.append(numbers[:7])
        velocities.append(velocity)
        attribute = str(row.get("attribute_name", ""))
        kept.append((CLASSES.index(row["detection_name"]), numbers[7], attribute))
    world = np.array(velocities).reshape(-1, 2)
    moves = sensor.vectors_to_local(np.column_stack([world, np.zeros(len(world))]))[:, :2]
    # Without velocities of the detector, those of the tracks are used.
    known = bool((np.abs(world) <= FARTHEST_M).all())
    classes, scores, attributes = zip(*kept, strict=True) if kept else ((), (), ())
    return Detections(
        np.array(classes, np.int64),
        sensor.boxes_to_local(np.array(boxes).reshape(-1, 7)),
        np.zeros(len(kept), np.int64),
        np.array(scores, float),
        moves if known else None,
        [one if one in ATTRIBUTES else "" for one in attributes],
    )
