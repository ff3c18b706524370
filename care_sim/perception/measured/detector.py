"""Detectors that report objects like CenterPoint, Megvii and PointRCNN on real data."""

import math
from typing import ClassVar

import numpy as np

from care_sim.base.checks import check_flag, check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.threads import ALONE, Threads
from care_sim.core.arrays import ONE_WORLD, Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Detections
from care_sim.perception.found import Found
from care_sim.perception.measured.candidates import SCORE, SEEN, X, kinds_of
from care_sim.perception.measured.luck import shares_of
from care_sim.perception.measured.recall import FIRST_HIT
from care_sim.perception.measured.reporting import Rules
from care_sim.perception.measured.tables import Measurement, measurement
from care_sim.perception.measured.worlds import MeasuredWorlds
from care_sim.perception.points_only import Detector
from care_sim.sensors.annotated import Annotations, Cloud

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

    def worlds(self, count: int, rig: Rig, is_filmed: bool, threads: Threads) -> MeasuredWorlds:
        """Return this detector in so many worlds, which `threads` share."""
        measured = self.measured
        # The closed loop drops boxes that become no track, so they need not be made.
        least = measured.least_score if is_filmed else self.least_tracked
        kinds = kinds_of(measured, rig.keyframe_s, least)
        if not self.false_boxes:
            kinds = kinds._replace(means=np.zeros_like(kinds.means))
        worth, angles = measured.recall.worth, cell_angles(rig)
        if self.worth is not None:
            worth, angles = np.full_like(worth, self.worth), np.ones_like(angles)
        rules = Rules(
            measured.recall._replace(worth=worth),
            shares_of(measured.luck, rig.keyframe_s, measured.flash_s),
            self.errors,
            kinds,
            sweep_weights(measured, self.first_hit, rig.keyframe_s, is_filmed),
            angles,
            float(measured.most_score),
            float(measured.kept_ahead),
            float(rig.sensor_height_m),
        )
        return MeasuredWorlds(rules, rig.grid, count, threads)

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

    def __init__(
        self, rules: MeasuredDetector, seed: np.random.SeedSequence, rig: Rig, is_filmed: bool
    ):
        self.track_score = rules.track_score
        self._measured = rules.measured
        self._grid = rig.grid
        self._world = rules.worlds(1, rig, is_filmed, ALONE)
        self._world.begin(0, seed)
        self._sensor = Frame(0.0, 0.0, rig.sensor_height_m, 0.0)
        self._found = Found.of(1)
        self._rows: dict[int, int] = {}
        self._objects = np.empty(0, np.int64)

    def at(self, token: str | None, sensor: Frame) -> None:
        """See `care_sim.perception.points_only.Detector`."""
        self._sensor = sensor

    def detect(self, cloud: Cloud, annotations: Annotations) -> tuple[Detections, Integers]:
        """See `care_sim.perception.points_only.Detector`."""
        self._meet(annotations.objects)
        sensor, world = self._sensor, self._world
        candidates = world.advance(ONE_WORLD, np.array([[sensor.x, sensor.y]], float))
        rows = candidates.rows[0, : candidates.counts[0]]
        rows[:, SEEN:] = sensor.boxes_to_local(rows[:, X:SCORE])
        classes, boxes = annotations.classes, np.ascontiguousarray(annotations.boxes, float)
        newest = cloud if cloud.newest is None else cloud.newest
        ranges = self._grid.ranges_to(newest.cells, newest.points)
        found = self._found = world.report(
            ONE_WORLD,
            (_count(classes), annotations.objects[None], classes[None], boxes[None]),
            (_count(cloud.cells), cloud.cells[None], cloud.objects[None]),
            (_count(ranges), newest.cells[None], ranges[None]),
            self._found,
            max(len(cloud.poses), 1),
        )
        # The tables are reused at the next keyframe.
        own = 0, slice(found.counts[0])
        scores = self._measured.reported(found.scores[own].copy())
        columns = found.classes[own].copy(), found.boxes[own].copy(), found.returns[own].copy()
        return Detections(*columns, scores), found.objects[own].copy()

    def _meet(self, objects: Integers) -> None:
        """Give new ones of this keyframe's `objects` (n,) a row of memory."""
        if np.array_equal(objects, self._objects):
            return
        known, world = self._rows, self._world
        met = len(known)
        rows = [known.setdefault(one, len(known)) for one in objects.tolist()]
        world.make_room(len(known))
        world.memory.first[0, met:] = world.clock[1][0]
        world.memory.rows[0, : len(rows)] = rows
        world.memory.ranks[0, : len(rows)] = np.argsort(np.argsort(objects))
        self._objects = objects


def _count(rows: np.ndarray) -> Integers:
    return np.array([len(rows)])


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
