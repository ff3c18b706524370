"""What goes wrong between a picture and the detections that arrive: misses, delays, a crooked
mount.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.core.conditions import CameraFaults
from care_sim.core.frames import Floats
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections

NOTHING_SEEN = ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS))))


class Misses:
    """Which objects the camera misses: in the long run the stated share, for a burst of keyframes
    at a time.

    One number is drawn for every object in every frame, seen or not, so that every policy meets the
    same misses.
    """

    def __init__(self, objects: int, faults: CameraFaults, rng: np.random.Generator):
        self._faults, self._rng = faults, rng
        self._lasting = np.zeros(objects, np.int64)
        self._started = False

    def draw(self, ranges: Floats) -> NDArray[np.bool_]:
        """(n,) who is missed in this frame; `ranges` (n,) are distances in metres."""
        if not (self._faults.false_negative_rate or self._faults.false_negative_per_m):
            return np.zeros(len(ranges), bool)
        burst = self._faults.false_negative_burst
        rates = np.minimum(
            self._faults.false_negative_rate + self._faults.false_negative_per_m * ranges, 1.0
        )
        draws = self._rng.random(len(rates))
        if self._started:
            begins = (self._lasting == 0) & (draws < rates / (burst - (burst - 1) * rates))
            self._lasting = np.where(begins, burst, self._lasting)
        else:
            hit = draws < rates
            served = np.floor(
                burst * np.divide(draws, rates, out=np.zeros_like(draws), where=hit)
            ).astype(np.int64)
            self._lasting = np.where(hit, burst - served, 0)
            self._started = True
        missed = self._lasting > 0
        self._lasting -= missed
        return missed


class _Taken(NamedTuple):
    detections: ImageDetections
    heading: float
    frame: int
    due: int


@dataclass
class Delay:
    """Hands out the newest picture that has arrived; each is late by the latency and its own
    jitter.
    """

    latency: int
    jitter: int
    keyframe_s: float
    rng: np.random.Generator

    def __post_init__(self) -> None:
        self._pictures: list[_Taken] = []
        self._frame = -1

    def newest(self, detections: ImageDetections, heading: float) -> ImageDetections:
        """Take in this keyframe's detections; return the newest that are due, with age and yaw
        change.
        """
        self._frame += 1
        late = self.latency + (int(self.rng.integers(self.jitter + 1)) if self.jitter else 0)
        self._pictures.append(_Taken(detections, heading, self._frame, self._frame + late))
        due = [
            number for number, picture in enumerate(self._pictures) if picture.due <= self._frame
        ]
        if not due:
            return NOTHING_SEEN
        self._pictures = self._pictures[due[-1] :]
        newest = self._pictures[0]
        count = len(newest.detections)
        return replace(
            newest.detections,
            ages=np.full(count, (self._frame - newest.frame) * self.keyframe_s),
            yaw_changes=np.full(count, heading - newest.heading),
        )


def mounted(camera: PinholeCamera, faults: CameraFaults, rng: np.random.Generator) -> PinholeCamera:
    """The camera as it really stands: turned and moved by errors that the rig does not know."""
    yaw, pitch = np.deg2rad(faults.camera_rotation_sigma_deg) * rng.standard_normal(2)
    shift = faults.camera_position_sigma_m * rng.standard_normal(3)
    x, y, z = (float(value) for value in camera.position + shift)
    return replace(
        camera, position=(x, y, z), yaw=camera.yaw + float(yaw), pitch=camera.pitch + float(pitch)
    )
