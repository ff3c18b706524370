"""What goes wrong between a picture and the detections that arrive: misses, ghosts, delays, a crooked mount."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.conditions import CONFIDENCE, CameraFaults
from care_sim.frames import Floats
from care_sim.pinhole import PinholeCamera
from care_sim.types import CLASSES, ImageDetections
from care_sim.world.bodies import CATALOGUE

GHOST_RANGE_M = (5.0, 40.0)
"""How far the near face of an object of a ghost's size would be: beyond the bonnet, as far as an adult has a box."""

NOTHING_SEEN = ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS))))


class Misses:
    """Which objects the camera misses: in the long run the stated share, for a burst of keyframes at a time.

    One number is drawn for every object in every frame, seen or not, so that every policy meets the same misses.
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
        rates = np.minimum(self._faults.false_negative_rate + self._faults.false_negative_per_m * ranges, 1.0)
        draws = self._rng.random(len(rates))
        if self._started:
            begins = (self._lasting == 0) & (draws < rates / (burst - (burst - 1) * rates))
            self._lasting = np.where(begins, burst, self._lasting)
        else:
            hit = draws < rates
            served = np.floor(burst * np.divide(draws, rates, out=np.zeros_like(draws), where=hit)).astype(np.int64)
            self._lasting = np.where(hit, burst - served, 0)
            self._started = True
        missed = self._lasting > 0
        self._lasting -= missed
        return missed


class Ghosts:
    """Boxes that show nothing: a Poisson number a picture, each as large as an object of a random class that
    stands somewhere on the road in view; confidences are even from the detector's threshold to 1.
    """

    def __init__(self, cameras: Sequence[PinholeCamera], height_m: float, rate: float, rng: np.random.Generator):
        self._cameras, self._height_m, self._rate, self._rng = cameras, height_m, rate, rng

    def draw(self) -> ImageDetections:
        """The ghosts of the pictures of this keyframe."""
        if not self._rate:
            return NOTHING_SEEN
        numbers = [n for n in range(len(self._cameras)) for _ in range(self._rng.poisson(self._rate))]
        rows = [self._row(number) for number in numbers]
        return ImageDetections.from_rows(np.array(rows).reshape(-1, len(ImageDetections.COLUMNS)))

    def _row(self, number: int) -> list[float]:
        camera, rng = self._cameras[number], self._rng
        label = int(rng.integers(len(CLASSES)))
        bearing, distance, yaw, confidence = rng.random(4)
        azimuth = camera.yaw + (bearing - 0.5) * 0.95 * camera.horizontal_fov
        size = CATALOGUE[CLASSES[label]].size
        reach = size[0] / 2 + GHOST_RANGE_M[0] + distance * (GHOST_RANGE_M[1] - GHOST_RANGE_M[0])
        place = (reach * np.cos(azimuth), reach * np.sin(azimuth), size[2] / 2 - self._height_m)
        (box,) = camera.project_boxes(np.array([[*place, *size, 2 * np.pi * yaw]]))
        low, high = np.floor(box[:2]), np.ceil(box[2:])
        limits = np.array([camera.width, camera.height])
        corners = (*np.clip(low, 0, limits - 1), *np.clip(high, 1, limits))
        return [label, CONFIDENCE + confidence * (1 - CONFIDENCE), *map(float, corners), number, 0, 0]


class _Taken(NamedTuple):
    detections: ImageDetections
    heading: float
    frame: int
    due: int


@dataclass
class Delay:
    """Hands out the newest picture that has arrived; each is late by the latency and its own jitter."""

    latency: int
    jitter: int
    keyframe_s: float
    rng: np.random.Generator

    def __post_init__(self) -> None:
        self._pictures: list[_Taken] = []
        self._frame = -1

    def newest(self, detections: ImageDetections, heading: float) -> ImageDetections:
        """Take in this keyframe's detections; return the newest that are due, with age and yaw change."""
        self._frame += 1
        late = self.latency + (int(self.rng.integers(self.jitter + 1)) if self.jitter else 0)
        self._pictures.append(_Taken(detections, heading, self._frame, self._frame + late))
        due = [number for number, picture in enumerate(self._pictures) if picture.due <= self._frame]
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
    return replace(camera, position=(x, y, z), yaw=camera.yaw + float(yaw), pitch=camera.pitch + float(pitch))
