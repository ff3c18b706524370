"""What goes wrong between a picture and the detections that arrive: misses, delays, a crooked
mount.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import CameraFaults
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.picture_timing import PictureTiming

NOTHING_SEEN = IdentifiedDetections(
    ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS)))), np.empty(0, np.int64)
)


class Misses:
    """Which objects the camera misses: in the long run the stated share, in bursts of keyframes.

    One number is drawn for every object at every keyframe, seen or not, so that every policy meets
    the same misses.
    """

    def __init__(self, objects: int, faults: CameraFaults, rng: np.random.Generator):
        self._faults = faults
        self._rng = rng
        self._lasting = np.zeros(objects, np.int64)
        """(n,) keyframes for which each object's burst still lasts."""
        self._started = False

    def draw(self, ranges: Floats) -> Mask:
        """(n,) who is missed at this keyframe; `ranges` (n,) are distances in metres."""
        faults = self._faults
        if not (faults.false_negative_rate or faults.false_negative_per_m):
            return np.zeros(len(ranges), bool)
        rates = miss_rates(faults.false_negative_rate, faults.false_negative_per_m, ranges)
        # One draw per object decides all: whether it is missed, and at the start for how long.
        draws = self._rng.random(len(rates))
        burst = faults.false_negative_burst
        if self._started:
            self._lasting = later_bursts(self._lasting, rates, draws, burst)
        else:
            self._lasting = first_bursts(rates, draws, burst)
        self._started = True
        missed = self._lasting > 0
        self._lasting -= missed
        return missed


def miss_rates(rate: float | Floats, per_m: float | Floats, ranges: Floats) -> Floats:
    """The share of keyframes at which objects so many metres away are missed, in any shape, by
    `false_negative_rate` and `false_negative_per_m`.
    """
    return np.minimum(rate + per_m * ranges, 1.0)


def first_bursts(rates: Floats, draws: Floats, burst: int | Integers) -> Integers:
    """For how many keyframes, from the first on, objects are missed that have these rates and
    draws. Arrays of one shape.

    The first keyframe shows the long run: an object is missed at its rate, and whoever is missed is
    at any keyframe of its burst with equal chance.
    """
    hit = draws < rates
    # A draw below the rate, divided by it, is again evenly distributed from 0 to 1.
    share = np.divide(draws, rates, out=np.zeros_like(draws), where=hit)
    served = np.floor(burst * share).astype(np.int64)
    return np.where(hit, burst - served, 0)


def later_bursts(
    lasting: Integers, rates: Floats, draws: Floats, burst: int | Integers
) -> Integers:
    """The same at a later keyframe, before which they were missed for `lasting` more: bursts begin
    among the objects that are in none.
    """
    # With the chance p that a burst of L keyframes begins, (1 - p) / p keyframes without one lie
    # between two bursts on the mean. The share of missed keyframes is L / (L + (1 - p) / p); it is
    # the rate r for p = r / (L - (L - 1) r).
    begins = (lasting == 0) & (draws < rates / (burst - (burst - 1) * rates))
    return np.where(begins, burst, lasting)


class _SentPicture(NamedTuple):
    """The detections of a picture on their way: that of `keyframe`, taken with the car's `heading`,
    they arrive at the keyframe `due`.
    """

    seen: IdentifiedDetections
    heading: float
    keyframe: int
    due: int


@dataclass
class Delay:
    """Hands out the newest picture that has arrived.

    One is taken per keyframe, as `timing` says. Each is late by its keyframes, and by 0 to `jitter`
    more that are drawn for it.
    """

    timing: PictureTiming
    jitter: int
    keyframe_s: float
    rng: np.random.Generator

    def __post_init__(self) -> None:
        self._sent: list[_SentPicture] = []
        self._taken = 0
        self._keyframe = -1

    def take(self, seen: IdentifiedDetections, heading: float) -> None:
        """Take in the detections of a keyframe's picture, and the car's heading when it was taken,
        radians.
        """
        # Lateness is drawn for every picture in turn, whatever it shows.
        late = self.timing.keyframes
        late += int(self.rng.integers(self.jitter + 1)) if self.jitter else 0
        self._sent.append(_SentPicture(seen, heading, self._taken, self._taken + late))
        self._taken += 1

    def newest(self, heading: float) -> IdentifiedDetections:
        """Begin a keyframe with the car's `heading`, radians; return the newest detections that are
        due, with age and yaw change.
        """
        self._keyframe += 1
        arrived = [n for n, picture in enumerate(self._sent) if picture.due <= self._keyframe]
        if not arrived:
            return NOTHING_SEEN
        # Jitter lets a picture overtake the ones before it, which are then never handed out.
        self._sent = self._sent[arrived[-1] :]
        return self._aged(self._sent[0], heading)

    def _aged(self, picture: _SentPicture, heading: float) -> IdentifiedDetections:
        age_s = (self._keyframe - picture.keyframe) * self.keyframe_s - self.timing.after_s
        detections = picture.seen.detections.aged(age_s, heading - picture.heading)
        return IdentifiedDetections(detections, picture.seen.objects)


def mounted(camera: PinholeCamera, faults: CameraFaults, rng: np.random.Generator) -> PinholeCamera:
    """The camera as it really stands: turned and moved by errors that the rig does not know."""
    # Drawn even where both spreads are 0, so that to switch one error on does not change what is
    # drawn for the other.
    yaw, pitch = np.deg2rad(faults.camera_rotation_sigma_deg) * rng.standard_normal(2)
    shift = faults.camera_position_sigma_m * rng.standard_normal(3)
    x, y, z = (float(value) for value in camera.position + shift)
    return replace(
        camera, position=(x, y, z), yaw=camera.yaw + float(yaw), pitch=camera.pitch + float(pitch)
    )
