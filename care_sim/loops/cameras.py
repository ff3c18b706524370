"""The cameras of the closed loop: what they show, and the detections that arrive of it."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.engines import Engine
from care_sim.sensors.false_boxes import BoxPool
from care_sim.sensors.pictures import Picture, class_table, faultless_detections, window_on
from care_sim.world.world import WORLD_STEP_S, World


class Cameras:
    """The cameras of a `rig` in a world, whose pictures an engine draws, and their detector.

    The scoring sees the world through the cameras as designed, the detector through those that are
    mounted; without an error of the mount the same pictures serve both.
    """

    pictures: tuple[Picture, ...]
    """What each camera as it was designed shows. Truth: for scoring and people."""
    seen: IdentifiedDetections
    """What the cameras as they are mounted show, before misses, false boxes and delay. Truth: for
    scoring and people.
    """

    after_s: float
    """Seconds from a keyframe to the pictures that the detector is given, 0 at the keyframe."""

    def __init__(
        self,
        world: World,
        rig: Rig,
        engine: Engine,
        sensing: Sensing,
        seed: np.random.SeedSequence,
        pool: BoxPool,
    ):
        labels = world.labels()
        self._world = world
        self._designed = rig.cameras
        self._engine = engine
        self._classes = class_table(labels)
        self._bodies = np.array(list(labels), np.int64)
        self._detector = CameraDetector(
            list(labels), sensing, rig.keyframe_s, seed, rig.cameras, pool, step_s=WORLD_STEP_S
        )
        self.after_s = self._detector.timing.after_s

    def look(self, sensor: Frame, heading: float) -> IdentifiedDetections:
        """Take the pictures of a keyframe, the LiDAR at `sensor` and the car taken to have the
        `heading`: the newest detections that are due.
        """
        boxes = sensor.boxes_to_local(self._world.boxes_of(self._bodies))
        self.pictures = taken = self._photographed(self._designed, sensor, boxes)
        if self._detector.mounted != self._designed:
            taken = self._photographed(self._detector.mounted, sensor, boxes)
        self.seen = faultless_detections(taken, self._classes)
        if not self.after_s:
            self._detector.take(self.seen, heading, boxes, self._world.time)
        return self._detector.newest(heading)

    def look_between(self, sensor: Frame, heading: float) -> None:
        """Take the pictures that the detector is given, `after_s` after a keyframe; see `look`."""
        boxes = sensor.boxes_to_local(self._world.boxes_of(self._bodies))
        taken = self._photographed(self._detector.mounted, sensor, boxes)
        seen = faultless_detections(taken, self._classes)
        self._detector.take(seen, heading, boxes, self._world.time)

    def shows(self, body: int) -> bool:
        """Whether a camera shows enough of a body for a box. Truth: for scoring and people."""
        return any(picture.shows(body) for picture in self.pictures)

    def faultless(self) -> IdentifiedDetections:
        """What a detector without faults would report of the cameras as designed. Truth: for
        scoring and people.
        """
        return faultless_detections(self.pictures, self._classes)

    def _photographed(
        self, cameras: tuple[PinholeCamera, ...], sensor: Frame, boxes: Floats
    ) -> tuple[Picture, ...]:
        """The pictures around boxes (n, 7) of all that the detector may ever report, in the sensor
        frame.
        """
        return tuple(
            Picture.listed(self._engine.visible_boxes(camera, sensor, window_on(camera, boxes)))
            for camera in cameras
        )
