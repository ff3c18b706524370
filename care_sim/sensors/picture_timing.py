"""When the pictures are taken whose detections a keyframe uses."""

import math
from typing import NamedTuple

from care_sim.base.times import LAST_BITS_S
from care_sim.core.conditions import CameraFaults


class PictureTiming(NamedTuple):
    """One picture per keyframe: it is taken `after_s` seconds after it, and its detections arrive
    `keyframes` keyframes after it.
    """

    keyframes: int
    after_s: float


def picture_timing(faults: CameraFaults, keyframe_s: float, step_s: float) -> PictureTiming:
    """The timing that `faults` ask for, of pictures that can be taken every `step_s` seconds, of
    which a keyframe of `keyframe_s` is a whole number.

    A latency in seconds is met by the newest picture that is at least so old.
    """
    if not faults.camera_latency_s:
        return PictureTiming(faults.camera_latency, 0.0)
    # Rounded up to steps; they are counted back from the keyframe at which the detections arrive.
    steps = math.ceil((faults.camera_latency_s - LAST_BITS_S) / step_s)
    per_keyframe = round(keyframe_s / step_s)
    keyframes = -(-steps // per_keyframe)
    return PictureTiming(keyframes, (keyframes * per_keyframe - steps) * step_s)
