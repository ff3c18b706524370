"""What a detector is. Real detectors are handed points, and no truth.

`PointsOnly` is the one place where a film meets a real detector. Whatever is installed or loaded
goes through it.
"""

from os import PathLike, fspath
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from care_sim.base.checks import check_flag
from care_sim.base.errors import InvalidInput, MissingExtra, error_line
from care_sim.base.extras import import_torch
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.frames import turned
from care_sim.core.types import CLASSES, Detections
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud


class Detector(Protocol):
    """What a loop calls at every keyframe."""

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """Detections in the sensor frame from the returns of the fired cells, and (n,) the
        annotated object behind each, or NO_OBJECT, for privileged policies and the scoring.
        """
        ...


MOST_DETECTIONS = 500
"""Boxes per keyframe: as many as the official nuScenes evaluation takes."""


class BrokenDetector(InvalidInput):
    """A detector that cannot be loaded or made, fails, or returns what is no `Detections`."""


class PointDetector(Protocol):
    """What a real detector is: sees the points of one keyframe, remembers nothing of the one
    before.
    """

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """Detections in the sensor frame from points (P, 3) in the sensor frame, metres; P may be
        0.

        The sensor is `sensor_height_m` above the road. The points are the detector's own to change.
        A detector whose attribute `wants_times` is true gets (P, 4): last the time of each point in
        seconds from the keyframe, 0 or less.
        `returns` are the points on each object, `scores` confidences from 0 to 1, or None. Whatever
        is returned becomes a track, so what is too unsure to act on is left out here; at most
        MOST_DETECTIONS.
        """
        ...


class PointsOnly:
    """Makes a `PointDetector` a `care_sim.perception.points_only.Detector`.

    The detector gets a copy of the points: neither objects nor boxes nor unfired cells can be
    reached from it. What it returns is copied and checked; only then the objects are named.
    """

    def __init__(self, name: str, detector: PointDetector, sensor_height_m: float):
        self._name = name
        self._detector = detector
        self._sensor_height_m = sensor_height_m

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`.

        Raises BrokenDetector where it fails or returns what is no detections.
        """
        # A copy: what the detector does to its points must not reach the film, which is shared.
        points = np.array(cloud.points, dtype=np.float64)
        if getattr(self._detector, "wants_times", False):
            times = np.zeros(len(cloud)) if cloud.times is None else cloud.times
            points = np.column_stack([points, times])
        try:
            found = self._detector.detect(points, self._sensor_height_m)
        except (KeyboardInterrupt, MissingExtra):
            raise
        except BaseException as error:
            raise BrokenDetector(
                f"detector {self._name} fails on {len(cloud)} points: {error_line(error)}"
            ) from error
        detections = checked(self._name, found, len(cloud))
        return detections, _objects_behind(detections.boxes, cloud)


def inside(points: Floats, boxes: Floats) -> Mask:
    """(n, P) whether each of points (P, 3) lies in each of boxes (n, 7). Raises InvalidInput for
    other boxes.
    """
    if boxes.ndim != 2 or boxes.shape[1] != 7:
        raise InvalidInput(f"boxes must have the shape (n, 7), got {boxes.shape}")
    # In the axes of a box, what lies within half its size along each of them lies in it.
    rows = [
        np.all(np.abs(turned(points - box[:3], -box[6])) <= box[3:6] / 2, axis=1) for box in boxes
    ]
    return np.array(rows, np.bool_).reshape(len(boxes), len(points))


def checked(name: str, found: Any, points: int) -> Detections:
    """`found` among so many `points`, with arrays of the contract's types; without detections they
    may be empty lists.

    Raises BrokenDetector with the detector's `name` and the fault.
    """
    if not isinstance(found, Detections):
        raise BrokenDetector(f"detector {name} must return Detections, got {type(found).__name__}")
    columns = (
        ("classes", "boxes", "returns")
        if found.scores is None
        else ("classes", "boxes", "returns", "scores")
    )
    table = {column: _numbers(name, column, getattr(found, column)) for column in columns}
    for column, values in table.items():
        shape = (len(table["classes"]), 7) if column == "boxes" else (len(table["classes"]),)
        if values.shape != shape:
            raise BrokenDetector(
                f"detector {name}: {column} must have the shape {shape}, got {values.shape}"
            )
    for fault in _faults(points, **table):
        raise BrokenDetector(f"detector {name}: {fault}")
    classes = table["classes"].astype(np.int64)
    returns = table["returns"].astype(np.int64)
    return Detections(classes, table["boxes"], returns, table.get("scores"))


def _objects_behind(boxes: Floats, cloud: Cloud) -> Integers:
    """(n,) the object that most of the returns within each box lie on, or NO_OBJECT."""
    # Returns on nobody have no vote: a box that stands on the road holds some of it.
    named = cloud.objects != NO_OBJECT
    objects = cloud.objects[named]
    counts = [
        np.unique(objects[row], return_counts=True) for row in inside(cloud.points[named], boxes)
    ]
    return np.array(
        [numbers[many.argmax()] if len(numbers) else NO_OBJECT for numbers, many in counts],
        np.int64,
    )


def _numbers(name: str, column: str, values: Any) -> Floats:
    try:
        numbers = np.array(values, dtype=np.float64, ndmin=1)
    except (TypeError, ValueError) as error:
        raise BrokenDetector(
            f"detector {name}: {column} must be an array of numbers, got {values!r:.80}"
        ) from error
    # What is detected ends in observations, which are float32. NaN fails this comparison, too.
    if not (np.abs(numbers) <= np.finfo(np.float32).max).all():
        raise BrokenDetector(f"detector {name}: {column} must be finite, in single precision")
    return numbers if numbers.size else numbers.reshape((0, 7) if column == "boxes" else 0)


def _faults(
    points: int, classes: Floats, boxes: Floats, returns: Floats, scores: Floats | None = None
) -> list[str]:
    # What must hold, each beside the sentence for whoever breaks it.
    rules: dict[str, Mask | bool] = {
        f"at most {MOST_DETECTIONS} detections are allowed, got {len(classes)}": len(classes)
        <= MOST_DETECTIONS,
        f"classes must be whole numbers from 0 to {len(CLASSES) - 1}": _is_count(classes)
        & (classes < len(CLASSES)),
        "lengths, widths and heights of boxes must be above 0": boxes[:, 3:6] > 0,
        f"returns must be whole numbers from 0 to the {points} points": _is_count(returns)
        & (returns <= points),
        "scores must lie in [0, 1]": True if scores is None else (scores >= 0) & (scores <= 1),
    }
    return [rule for rule, kept in rules.items() if not np.all(kept)]


def _is_count(numbers: Floats) -> Mask:
    return np.asarray((numbers >= 0) & (numbers % 1 == 0))


class TorchScriptDetector:
    """A learned detector from a TorchScript file, and the example to follow for one's own.

    Runs the module in `file`: `forward(points, sensor_height_m) -> (classes, boxes, scores)`.

    `points` is a float32 tensor (P, 3) in the sensor frame, `sensor_height_m` a float; `classes`
    (n,) index `care_sim.core.types.CLASSES`, `boxes` (n, 7) are x, y, z, length, width, height, yaw
    in the sensor frame, `scores` (n,) lie in [0, 1]. With `times` the points are (P, 4), last the
    seconds from the keyframe, 0 or less. Runs on the CPU. Needs torch. Raises MissingExtra without
    it, InvalidInput for a file that is no TorchScript module.

    One around an ONNX file, in a package of its own:

        class OnnxDetector:
            def __init__(self, file: str):
                self._session = onnxruntime.InferenceSession(file)

            def detect(self, points, sensor_height_m):
                inputs = {"points": points.astype("float32")}
                classes, boxes, scores = self._session.run(None, inputs)
                return Detections(classes, boxes, inside(points, boxes).sum(axis=1), scores)

    is found under the name `mine` by this entry in the package's pyproject.toml:

        [project.entry-points."care_sim.detectors"]
        mine = "my_package:OnnxDetector"
    """

    def __init__(self, file: str | PathLike[str], times: bool = False):
        check_flag("times", times)
        self.wants_times = times
        self._torch = import_torch()
        self._file = fspath(file)
        if not Path(file).is_file():
            raise InvalidInput(
                f"{self._file}: no such file; allowed is a TorchScript module (torch.jit.save)"
            )
        try:
            self._module = self._torch.jit.load(self._file, map_location="cpu").eval()
        except RuntimeError as error:
            raise InvalidInput(f"{self._file}: no TorchScript module (torch.jit.save)") from error

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`."""
        # Nothing is learned here, so no gradients are kept.
        with self._torch.inference_mode():
            outputs = self._module(
                self._torch.from_numpy(points.astype(np.float32)), float(sensor_height_m)
            )
        classes, boxes, scores = (output.numpy() for output in outputs)
        return Detections(classes, boxes, inside(points[:, :3], boxes).sum(axis=1), scores)
