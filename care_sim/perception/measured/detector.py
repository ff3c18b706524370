"""Detectors that report objects like CenterPoint, Megvii and PointRCNN on real data."""

import math
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_flag, check_number
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Detections
from care_sim.perception.measured.false_boxes import FalseBoxPopulation
from care_sim.perception.measured.luck import CHANNELS, Memory, shares_of
from care_sim.perception.measured.recall import FIRST_HIT
from care_sim.perception.measured.reporting import report_objects
from care_sim.perception.measured.tables import SIGNALS, Measurement, measurement
from care_sim.perception.points_only import Detector
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud

GATHERED_S = 1.0
"""In the closed loop, and in films with short keyframes, a detector that gathers ten sweeps has
those of the last ten keyframes, of 0.1 s each. With longer keyframes it has as many as fit in this
time.
"""


class MeasuredDetector(Detector):
    """A detector as measured: it reports an object with a chance that grows with its returns.

    `first_hit` is the weight, in films, of a return that was not there a keyframe ago. It is 0.55
    for ten equal sweeps since then, 0.1 if the mask before fired nine of ten sweeps, 1.0 if the
    next mask fired all. It has no effect in the closed loop, nor in films with keyframes of less
    than 0.5 s, where earlier sweeps are known.

    `worth` is the number of returns of the detector's own sensor that one return counts. The
    default is measured by class and divided by the density of rays; on sweeps of that sensor it is
    1. Detections below `track_score`, in the detector's own scale, become no track. `false_boxes`
    and `box_errors` switch these on.

    Raises InvalidInput for a value out of its bounds.
    """

    name: ClassVar[str]

    def __init__(
        self,
        first_hit: float = FIRST_HIT,
        worth: float | None = None,
        track_score: float | None = None,
        false_boxes: bool = True,
        box_errors: bool = True,
    ):
        self.measured = measured = measurement(self.name)
        least = measured.track_score if track_score is None else track_score
        check_number("first_hit", first_hit, 0, 1)
        check_number("track_score", least, measured.least_score, measured.most_score)
        check_flag("false_boxes", false_boxes)
        check_flag("box_errors", box_errors)
        if worth is not None:
            check_number("worth", worth, 0.001, 1000)
        self.first_hit = float(first_hit)
        self.worth = worth
        self.least_tracked = float(least)
        self.false_boxes = false_boxes
        self.errors = measured.errors if box_errors else measured.errors.without()
        self.track_score = float(measured.reported(np.array(least)))

    def begin(self, seed: np.random.SeedSequence, rig: Rig, is_filmed: bool) -> Detector:
        """See `care_sim.perception.points_only.Detector`."""
        return MeasuredEpisode(self, seed, rig, is_filmed)

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """Raises InvalidInput: luck belongs to an episode, which `begin` starts."""
        raise InvalidInput(f"detector {self.name} needs an episode: call begin before detect")


class CenterPoint(MeasuredDetector):
    """CenterPoint as measured on nuScenes, by returns: recall, luck, scores, false boxes."""

    name = "centerpoint"


class Megvii(MeasuredDetector):
    """Megvii (CBGS) as measured on nuScenes, by returns: as centerpoint, with its own numbers."""

    name = "megvii"


class PointRCNN(MeasuredDetector):
    """PointRCNN as measured on KITTI, by returns; no trucks and no buses."""

    name = "pointrcnn"


class MeasuredEpisode(Detector):
    """A measured detector in one episode; call `detect` once per keyframe."""

    wants_points = False
    is_matched = True

    def __init__(
        self, rules: MeasuredDetector, seed: np.random.SeedSequence, rig: Rig, is_filmed: bool
    ):
        measured = rules.measured
        self.track_score = rules.track_score
        self._measured = measured
        self._errors = rules.errors
        # The closed loop drops boxes that become no track, so they need not be made.
        self._least = measured.least_score if is_filmed else rules.least_tracked
        worth = measured.recall.worth
        if rules.worth is not None:
            worth = np.full(len(worth), float(rules.worth))
        self._table = measured.recall._replace(worth=worth)
        self._heads = [head.first for head in rig.grid.heads]
        self._angles = cell_angles(rig) if rules.worth is None else np.ones(len(self._heads))
        self._weights = sweep_weights(measured, rules.first_hit, rig.keyframe_s, is_filmed)
        self._seed = seed.generate_state(1, np.uint64)[0]
        self._shares = shares_of(measured.luck, rig.keyframe_s, measured.flash_s)
        self._false = (
            FalseBoxPopulation(
                measured, self._least, rig.grid, rig.sensor_height_m, rig.keyframe_s, seed
            )
            if rules.false_boxes
            else None
        )
        self._sensor = Frame(0.0, 0.0, rig.sensor_height_m, 0.0)
        self._keyframe = 0
        self._rows: dict[int, int] = {}
        none = np.empty(0, np.int64)
        self._objects, self._places, self._ascending, self._ranks = none, none, none, none
        self._memory = Memory(none, np.empty((0, len(SIGNALS)), np.int64), np.empty((0, CHANNELS)))
        self._counts = np.empty((0, len(self._weights)))

    def at(self, token: str | None, sensor: Frame) -> None:
        """See `care_sim.perception.points_only.Detector`."""
        self._sensor = sensor

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`."""
        self._meet(annotations.objects)
        rows, boxes, scores, returns = report_objects(
            (self._seed, self._keyframe),
            (annotations.objects, annotations.classes, self._places),
            np.ascontiguousarray(annotations.boxes, float),
            (cloud.objects, self._ascending, self._ranks, max(len(cloud.poses), 1)),
            (np.append(np.searchsorted(cloud.cells, self._heads), len(cloud)), self._angles),
            self._memory,
            (self._counts, self._weights),
            (self._table, self._shares, self._errors),
            (self._least, self._measured.most_score),
        )
        classes, objects = annotations.classes[rows], annotations.objects[rows]
        if self._false is not None:
            false = self._false.draw(self._keyframe, self._sensor, cloud, annotations)
            classes = np.concatenate([classes, false.classes])
            boxes = np.concatenate([boxes, false.boxes])
            scores = np.concatenate([scores, false.scores])
            returns = np.concatenate([returns, false.returns])
            objects = np.concatenate([objects, np.full(len(false.classes), NO_OBJECT)])
        self._keyframe += 1
        return Detections(classes, boxes, returns, self._measured.reported(scores)), objects

    def _meet(self, objects: Integers) -> None:
        """Return the rows of this keyframe's `objects` (n,), adding rows of new ones."""
        # The closed loop reports the same bodies at every keyframe.
        if np.array_equal(objects, self._objects):
            return
        known = self._rows
        self._places = np.array(
            [known.setdefault(one, len(known)) for one in objects.tolist()], int
        )
        order = np.argsort(objects)
        self._objects, self._ascending = objects, objects[order]
        self._ranks = np.argsort(order)
        if (new := len(known) - len(self._counts)) > 0:
            first, last, processes = self._memory
            self._memory = Memory(
                np.concatenate([first, np.full(new, self._keyframe)]),
                np.concatenate([last, np.full((new, len(SIGNALS)), -1)]),
                np.concatenate([processes, np.zeros((new, CHANNELS))]),
            )
            self._counts = np.concatenate([self._counts, np.zeros((new, self._counts.shape[1]))])


def sweep_weights(
    measured: Measurement, first_hit: float, keyframe_s: float, is_filmed: bool
) -> Floats:
    """Return (k,) the weights of this keyframe's returns and of earlier ones, newest first."""
    if measured.sweeps == 1:
        return np.ones(1)
    if is_filmed and keyframe_s > measured.step_s - 1e-9:
        return np.array([first_hit, 1 - first_hit])
    return np.ones(min(measured.sweeps, max(1, math.floor(GATHERED_S / keyframe_s + 1e-9))))


def cell_angles(rig: Rig) -> Floats:
    """Return the solid angle (k,) of a cell of each LiDAR, in cells of the default grid.

    The worth of a return was measured for that grid: of denser rays each is worth less.
    """
    usual = AngularGrid()
    angles = [head.grid.column_width * head.grid.row_height for head in rig.grid.heads]
    return np.array(angles) / (usual.column_width * usual.row_height)
