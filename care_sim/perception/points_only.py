"""The interface of detectors. Real ones get points and no truth.

`PointsOnly` is the only place where a film meets a real detector. Every installed or loaded
detector goes through it.
"""

import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any, Protocol, Self, SupportsIndex

import numpy as np

from care_sim.base.checks import check_known, check_number, check_whole
from care_sim.base.errors import InvalidInput, MissingExtra, error_line
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.frames import Frame, turned
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Detections
from care_sim.sensors.annotated import AT_KEYFRAME, NO_OBJECT, Annotations, Cloud, SweepPose


class Detector(ABC):
    """A detector, which a loop calls at every keyframe.

    `gathers`: number of sweeps per keyframe in the closed loop, its own included. `track_score`:
    least score of a detection that becomes a track. `files`: further files that it reads, beside
    those of its parameters and entry point.
    """

    gathers: int = 1
    track_score: float = 0.0
    files: tuple[Path, ...] = ()

    def begin(self, seed: np.random.SeedSequence, rig: Rig, is_filmed: bool) -> "Detector":
        """Return the detector of an episode with this `seed`: itself if it is stateless.
        `is_filmed` is True for a film, whose keyframes may be several sweeps apart.
        """
        return self

    def at(self, token: str | None, sensor: Frame) -> None:
        """Set the next keyframe: its name in a film, None in the closed loop, and the sensor's
        frame.
        """

    @abstractmethod
    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """Return detections in the sensor frame from the returns of the fired cells. Also returns
        (n,) the annotated object behind each, or NO_OBJECT, for privileged policies and the
        scoring.
        """


MOST_SWEEPS = 100
"""Sweeps that a detector may gather: five seconds of a LiDAR that turns 20 times a second."""
MOST_DETECTIONS = 500
"""Boxes per keyframe: as many as the official nuScenes evaluation takes."""


ATTRIBUTES = (
    "", "cycle.with_rider", "cycle.without_rider", "pedestrian.moving",
    "pedestrian.sitting_lying_down", "pedestrian.standing", "vehicle.moving", "vehicle.parked",
    "vehicle.stopped",
)  # fmt: skip
"""Attributes of nuScenes, and an empty one."""
_WIDTHS = {"boxes": 7, "velocities": 2}
"""Numbers per detection, of columns with several."""


class BrokenDetector(InvalidInput):
    """A detector that cannot be loaded or made, fails, or returns no valid `Detections`."""


FIELDS = ("x", "y", "z", "intensity", "ring", "time_lag")
"""Columns of points that a detector may request. Places are in the sensor frame, metres.
`intensity` from 0 to 1; 0 where it is not measured, as in generated worlds without
`lidar_stated_range_m`. `ring`: the laser, 0 the lowest, as nuScenes counts. `time_lag`: seconds
since the point was measured, 0 or more, as CenterPoint counts.
"""


class PointDetector(Protocol):
    """A real detector: returns boxes from the points of one keyframe.

    A detector is made anew for every play, so that it carries nothing from one play to the next.
    Set `stateless = True` if its results depend only on the arguments of `detect`: not on earlier
    calls, nor on random numbers of the process. A stateless detector is made once per process and
    set of parameters, and serves all plays there. Two threads may call it at once. Copies of an
    environment share it, and a pickle makes it again from its parameters. Any other detector is
    copied and pickled with its state.

    Further optional attributes set a detector's input:

    - `fields`: columns of the points, from `FIELDS` (x, y and z).
    - `sweeps`: number of sweeps per keyframe (1). In films, `--sweeps` overrides it.
    - `track_score`: the least score of a detection that becomes a track (0). All are exported.
    - `far`: whether it gets a recorded LiDAR's points beyond the reach of the grid (True).
    - `wants_poses`: whether `detect` gets the `poses` of the sweeps (False).

    A detector whose files name further files, such as the base of a config, sets `files` to their
    paths when it is made. The hash of a row covers them, and a detector is made anew after one of
    them has changed.

    `sweeps` and `track_score` are also parameters of every detector by name.
    """

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """Return detections in the sensor frame from points (P, 3), or (P, k) with `fields`; P may
        be 0.

        The sensor is `sensor_height_m` above the road. The detector may change the points. Points
        of earlier sweeps compensate the car's motion, not that of others. `poses`, if wanted, are
        `SweepPose`s, the keyframe's first.

        `returns` are the points on each object, `scores` confidences from 0 to 1, or None,
        `velocities` and `attributes` the detector's own, or None; at most MOST_DETECTIONS.
        """


def is_stateless(detector: object) -> bool:
    """Return True if a detector promises that its results depend only on its arguments."""
    return getattr(detector, "stateless", False) is True


def files_of(detector: object) -> tuple[Path, ...]:
    """Return the files that a detector declared when it was made. Files of its class belong to its
    entry point.
    """
    files = getattr(detector, "files", None)
    return () if files is getattr(type(detector), "files", None) else tuple(map(Path, files or ()))


class PointsOnly(Detector):
    """Wraps a `PointDetector` as a `care_sim.perception.points_only.Detector`.

    The detector gets a copy of the points. It cannot reach objects, boxes or unfired cells. Its
    results are copied and checked; only then the objects are named.

    `again` makes the same detector for another play or process. Without it one detector serves all
    plays, and a pickle holds it whole.
    """

    def __init__(
        self,
        name: str,
        detector: PointDetector,
        sensor_height_m: float,
        sweeps: int | None = None,
        track_score: float | None = None,
        again: Callable[[], Detector] | None = None,
    ):
        self._name = name
        self._detector = detector
        self._again = again
        self.files = files_of(detector)
        self._has_played = False
        self._sensor_height_m = sensor_height_m
        self._fields = tuple(getattr(detector, "fields", FIELDS[:3]))
        for field in self._fields:
            try:
                check_known(f"field of detector {name}", field, FIELDS)
            except InvalidInput as error:
                raise BrokenDetector(str(error)) from error
        self._far = getattr(detector, "far", True)
        self._wants_poses = getattr(detector, "wants_poses", False)
        self.gathers = getattr(detector, "sweeps", 1) if sweeps is None else sweeps
        check_whole(f"sweeps of detector {name}", self.gathers, 1, MOST_SWEEPS)
        least = getattr(detector, "track_score", 0.0) if track_score is None else track_score
        check_number(f"track_score of detector {name}", least, 0, 1)
        self.track_score = float(least)

    def begin(self, seed: np.random.SeedSequence, rig: Rig, is_filmed: bool) -> Detector:
        """See `Detector`. A detector that is not stateless is made anew after its first episode."""
        if is_stateless(self._detector) or self._again is None or not self._has_played:
            return self
        return self._again()

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`.

        Raises BrokenDetector if the detector fails or returns no valid detections.
        """
        self._has_played = True
        poses = cloud.poses or (AT_KEYFRAME,)
        if self._far:
            cloud = cloud.whole
        # A copy: what the detector does to its points must not reach the film, which is shared.
        points = np.column_stack([_column(cloud, field) for field in self._fields]).astype(float)
        own = [SweepPose(lag_s, matrix.copy()) for lag_s, matrix in poses]
        told = {"poses": own} if self._wants_poses else {}
        try:
            found = self._detector.detect(points, self._sensor_height_m, **told)
        except (KeyboardInterrupt, MissingExtra):
            raise
        except BaseException as error:
            raise BrokenDetector(
                f"detector {self._name} fails on {len(cloud)} points: {error_line(error)}"
            ) from error
        detections = checked(self._name, found, len(cloud))
        return detections, objects_behind(detections.boxes, cloud)

    def __deepcopy__(self, copied: dict[int, Any]) -> Self:
        # Within a process the weights are shared.
        if is_stateless(self._detector):
            return self
        other = object.__new__(type(self))
        copied[id(self)] = other
        vars(other).update(vars(self) | {"_detector": self._copied(deepcopy, copied)})
        return other

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        if is_stateless(self._detector) and self._again is not None:
            return self._again, ()
        # Pickle once in advance, for an error that names the detector.
        self._copied(pickle.dumps, protocol)
        return super().__reduce_ex__(protocol)

    def _copied(self, copy: Callable[..., Any], *how: object) -> Any:
        """Copy the detector. Raises BrokenDetector where its class does not allow that."""
        try:
            return copy(self._detector, *how)
        except Exception as error:
            raise BrokenDetector(
                f"detector {self._name} cannot be copied: {error_line(error)}; {self._mend()}"
            ) from error

    def _mend(self) -> str:
        """Return the hint that makes a copy possible."""
        if is_stateless(self._detector):
            return "make it by name (`care_sim.perception.detectors.make_detector`)"
        return "set `stateless = True` if its answers depend on the arguments of `detect` alone"


def _column(cloud: Cloud, field: str) -> Floats | Integers:
    """Return (P,) a field of the returns."""
    if field in FIELDS[:3]:
        return cloud.points[:, FIELDS.index(field)]
    values = {"intensity": cloud.intensities, "ring": cloud.rings, "time_lag": cloud.times}[field]
    if values is None:
        return np.zeros(len(cloud))
    return -values if field == "time_lag" else values


def inside(points: Floats, boxes: Floats) -> Mask:
    """Return (n, P) whether each of points (P, 3) lies in each of boxes (n, 7). Raises InvalidInput
    for other boxes.
    """
    if boxes.ndim != 2 or boxes.shape[1] != 7:
        raise InvalidInput(f"boxes must have the shape (n, 7), got {boxes.shape}")
    # In the axes of a box, a point within half its size along each axis is inside.
    rows = [
        np.all(np.abs(turned(points - box[:3], -box[6])) <= box[3:6] / 2, axis=1) for box in boxes
    ]
    return np.array(rows, np.bool_).reshape(len(boxes), len(points))


def checked(name: str, found: Any, points: int) -> Detections:
    """Return `found` among this many `points`, with arrays of the contract's types. Without
    detections they may be empty lists.

    Raises BrokenDetector with the detector's `name` and the fault.
    """
    if not isinstance(found, Detections):
        raise BrokenDetector(f"detector {name} must return Detections, got {type(found).__name__}")
    optional = [c for c in ("scores", "velocities") if getattr(found, c) is not None]
    columns = ("classes", "boxes", "returns", *optional)
    table = {column: _numbers(name, column, getattr(found, column)) for column in columns}
    velocities = table.get("velocities")
    for column, values in table.items():
        count = len(table["classes"])
        shape = (count, _WIDTHS[column]) if column in _WIDTHS else (count,)
        if values.shape != shape:
            raise BrokenDetector(
                f"detector {name}: {column} must have the shape {shape}, got {values.shape}"
            )
    scores = table.get("scores")
    for fault in _faults(points, table["classes"], table["boxes"], table["returns"], scores):
        raise BrokenDetector(f"detector {name}: {fault}")
    classes = table["classes"].astype(np.int64)
    returns = table["returns"].astype(np.int64)
    attributes = None if found.attributes is None else [*map(str, found.attributes)]
    if attributes is not None and len(attributes) != len(classes):
        count = len(attributes)
        raise BrokenDetector(f"detector {name}: attributes must be {len(classes)}, got {count}")
    for attribute in attributes or ():
        if attribute not in ATTRIBUTES:
            allowed = ", ".join(filter(None, ATTRIBUTES))
            raise BrokenDetector(
                f"detector {name}: attributes must be of {allowed}, or empty, got {attribute!r:.80}"
            )
    return Detections(classes, table["boxes"], returns, scores, velocities, attributes)


def objects_behind(boxes: Floats, cloud: Cloud) -> Integers:
    """Return (n,) the object with most of the returns within each box, or NO_OBJECT."""
    # Returns without an object do not count: a box on the road holds some of the road.
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
    # Detections enter observations, which are float32. NaN fails this comparison, too.
    if not (np.abs(numbers) <= np.finfo(np.float32).max).all():
        raise BrokenDetector(f"detector {name}: {column} must be finite, in single precision")
    if numbers.size:
        return numbers
    return np.empty((0, _WIDTHS[column]) if column in _WIDTHS else 0)


def _faults(
    points: int, classes: Floats, boxes: Floats, returns: Floats, scores: Floats | None = None
) -> list[str]:
    # Conditions, each with the message for a violation.
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
