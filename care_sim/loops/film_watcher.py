"""The open loop with all that is true about it, for people who watch a play."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.actions import shares_of
from care_sim.core.arrays import Floats
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES, Action, Demand, ImageDetections
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.loops.watcher import TrueSituation, Watched
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.world.bodies import CATALOGUE


@dataclass(frozen=True)
class WatchedScene(Watched):
    """A keyframe of the open loop; the bodies of its situation are the annotated objects."""

    record: SceneKeyframe
    """What it found."""


class FilmWatcher:
    """Follows the running play of a loop: `situation` is asked before every keyframe, `watched`
    after it.

    `confidence` is the threshold of the camera's detector.
    """

    def __init__(self, loop: OpenLoop, confidence: float):
        self._loop = loop
        self._confidence = confidence

    def situation(self) -> TrueSituation:
        """How things stand before the next keyframe."""
        loop = self._loop
        shot, shown = loop.shot, loop.belief.detections
        annotations = shot.annotations
        named = zip(annotations.classes.tolist(), annotations.objects.tolist(), strict=True)
        return TrueSituation(
            time_s=shot.time_s,
            sensor=shot.sensor,
            ego=shot.sensor.boxes_to_world(self._ego_box()[None])[0],
            way=np.empty((0, 3)),
            names=tuple(f"{CLASSES[label]} {number}" for label, number in named),
            labels=tuple(annotations.classes.tolist()),
            bodies=shot.sensor.boxes_to_world(annotations.boxes),
            target=None,
            belief=loop.belief,
            known=explained(shown, loop.belief.tracks, loop.rig),
            false=loop.true_detected_objects() == NO_OBJECT,
            missed=self._missed(),
        )

    def watched(
        self,
        situation: TrueSituation,
        action: Action,
        demand: Demand | None,
        record: SceneKeyframe,
    ) -> WatchedScene:
        """The keyframe that the loop has played since the situation."""
        assert record.fired is not None
        shares = shares_of(record.fired, action, demand, self._loop.rig)
        return WatchedScene(situation, shares, self._loop.last_ranges, record)

    def _ego_box(self) -> Floats:
        """(7,) the box of the car in the sensor frame."""
        x, y, height = self._loop.film.position
        size = CATALOGUE["ego"].size
        return np.array([-x, -y, size[2] / 2 - height, *size, 0.0])

    def _missed(self) -> ImageDetections:
        """What a camera without faults would report now, less the objects that the belief has."""
        seen = self._loop.shot.seen
        given = self._loop.true_detected_objects()
        sure = seen.detections.confidences >= self._confidence
        rows = seen.detections.rows()[sure & ~np.isin(seen.objects, given)]
        return ImageDetections.from_rows(rows)
