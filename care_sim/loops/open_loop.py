"""One keyframe of the open loop: fire, detect, track, look. The world is a film, which does not
react.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.conditions import COMING, Sensing
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Detections, Scan
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Film, Shot
from care_sim.loops.gathering import acted_on, gather_sweeps
from care_sim.loops.givens import Given, givens_of
from care_sim.loops.observation_limits import Limits
from care_sim.loops.truth import Told, TrueLoop, told_by
from care_sim.perception.points_only import Detector
from care_sim.perception.tracker import MemoryRules, TrackMemory
from care_sim.sensors.annotated import NO_RETURNS, Cloud
from care_sim.sensors.lidar import RecordedLidar


@dataclass(frozen=True)
class OpenLoopKeyframe:
    """The record of one keyframe of the open loop: what was fired, and what the detector made of
    the returns.

    `detections` became tracks; `reported` are these and what was too unsure. `velocities` (n, 2),
    over ground, in sensor axes, are the detector's, or without these the tracks'. They are 0 for a
    track that has just begun and for a detection that became none.
    """

    index: int
    fired: Cells
    detections: Detections
    reported: Detections
    velocities: Floats


class OpenLoop(TrueLoop):
    """A film, the sensors and the car's software over its keyframes.

    Its attributes are of the coming keyframe: they change with every call of `keyframe`.
    """

    belief: Belief
    """All that a policy may know when it chooses the cells."""
    told: Told
    """Return data of the last keyframe besides ranges."""
    handed: Cloud
    """The returns that the detector was given at the last keyframe. None before the first one, and
    none in a copy: sweeps are large, and a copy plays on without them.
    """
    last_ranges: NDArray[np.float32]
    """(E, A) the scan of the last keyframe in metres: 0 not fired, maximum range without a return.
    """

    def __init__(
        self,
        film: Film,
        rig: Rig,
        sensing: Sensing,
        seeds: SensorSeeds,
        detector: Detector,
    ):
        super().__init__()
        self.film = film
        self.rig = rig
        self._lidar = RecordedLidar(rig.grid, sensing, seeds.lidar)
        self._detector = detector.begin(seeds.detector, rig, is_filmed=True)
        self._limits = Limits(rig)
        followed = MemoryRules(velocity_keyframes=sensing.velocity_keyframes)
        self._memory = TrackMemory(film.keyframe_s, followed)
        self._sweep_mask = sensing.sweep_mask
        self._givens = givens_of(film, sensing, seeds)
        self._held: Cells = np.empty(0, np.int64)
        self.told = {}
        self.handed = NO_RETURNS
        self.last_ranges = np.zeros(rig.grid.shape, np.float32)
        self._look(self.last_ranges)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"handed": NO_RETURNS}

    @property
    def over(self) -> bool:
        """Whether every keyframe was shown."""
        return self.index == len(self.film.shots)

    @property
    def shot(self) -> Shot:
        """The keyframe for which cells are chosen now."""
        return self.film.shots[self.index]

    def keyframe(self, fired: Cells) -> OpenLoopKeyframe:
        """Fire `fired`, detect on the returns, and advance to the next keyframe."""
        index = self.index
        shot = self.shot

        # In the order of the closed loop, but for the car: a film moves on by itself.
        cloud = self._lidar.fire(fired, shot.cloud)
        self.told = told_by(fired, cloud.cells, cloud.intensities, cloud.times)
        mask = fired if self._sweep_mask == COMING else self._held
        self.handed = gather_sweeps(cloud, partial(self._lidar.fire, mask), shot)
        self._held = fired
        self._detector.at(shot.token, shot.sensor)
        reported, objects = self._detector.detect(self.handed, shot.annotations)
        sure = acted_on(reported, self._detector.track_score)
        detections = reported if sure.all() else reported.take(sure)
        taken_for = self._given.taken_for
        tracks = self._memory.update(detections, taken_for)
        self._note(tracks, objects[sure])
        velocities = reported.velocities
        if velocities is None:
            velocities = np.zeros((len(reported), 2))
            velocities[sure] = self._memory.velocities(tracks, taken_for)

        # After the last keyframe there is nothing to look at, and no cells are to be chosen.
        self.index += 1
        self._memory.predict()
        self.last_ranges = self._range_image(fired, cloud)
        if not self.over:
            self._look(self.last_ranges)
        return OpenLoopKeyframe(index, fired, detections, reported, velocities)

    def true_detected_objects(self) -> Integers:
        """(n,) the numbers of the objects behind the camera detections of the belief, NO_OBJECT for
        a false box.

        Truth: for the scoring alone.
        """
        arrived = self._given.arrived
        return arrived.objects[self._limits.kept_detections(arrived.detections)]

    def full_scan(self) -> Scan:
        """See `TrueLoop.full_scan`."""
        return Scan(
            np.arange(self.rig.grid.size), self._lidar.ranges(self._lidar.peek(self.shot.cloud))
        )

    def _present(self, objects: Sequence[int]) -> dict[int, Floats]:
        annotations = self.shot.annotations
        return dict(zip(annotations.objects.tolist(), annotations.boxes, strict=True))

    @property
    def _given(self) -> Given:
        return self._givens[self.index]

    def _look(self, ranges: NDArray[np.float32]) -> None:
        taken_for, ego, arrived = self._given
        tracks = self._memory.tracks(taken_for)
        self.belief = self._limits.belief(ego, arrived.detections, tracks, ranges)

    def _range_image(self, fired: Cells, cloud: Cloud) -> NDArray[np.float32]:
        ranges = np.zeros(self.rig.grid.size, np.float32)
        ranges[fired] = np.minimum(self._lidar.ranges(cloud)[fired], self.rig.grid.range_m)
        return ranges.reshape(self.rig.grid.shape)


@dataclass(frozen=True)
class SceneKeyframe:
    """The annotated objects (n,) of a keyframe: which were `found`, which are `scored` (within
    range), and which are `appearing` (their first sighting). `time_s` is from the start; `record`
    is None before the first scan.

    Truth: never for a policy.
    """

    time_s: float
    record: OpenLoopKeyframe | None
    found: Mask
    scored: Mask
    appearing: Mask

    @property
    def index(self) -> int:
        """The number of the keyframe, from 0."""
        return self.record.index if self.record else 0

    @property
    def fired(self) -> Cells | None:
        """The cells that fired, each as often as it was fired."""
        return self.record.fired if self.record else None

    @property
    def objects(self) -> int:
        """How many objects are scored."""
        return int(self.scored.sum())

    @property
    def objects_found(self) -> int:
        """How many of them were found."""
        return int((self.found & self.scored).sum())

    @property
    def entries(self) -> int:
        """How many appear for the first time."""
        return int(self.appearing.sum())

    @property
    def entries_found(self) -> int:
        """How many of these were found at once."""
        return int((self.found & self.appearing).sum())
