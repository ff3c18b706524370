"""Detections in the results form of the nuScenes detection task, which the official devkit scores.

The form:
https://github.com/nutonomy/nuscenes-devkit/blob/master/python-sdk/nuscenes/eval/detection/README.md
"""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.forgetting import ForgettingRules
from care_sim.core.frames import turned
from care_sim.core.types import CLASSES, Detections
from care_sim.loops.film import Shot
from care_sim.sources.nuscenes.table_files import JsonRow

MODALITIES = {
    "use_camera": True,
    "use_lidar": True,
    "use_radar": False,
    "use_map": False,
    "use_external": False,
}
"""What the form's `meta` must tell. The camera decides where a policy looks, and the LiDAR measures
the boxes.
"""
MOST_BOXES = 500
"""A sample with more is refused."""
STANDING_MPS = ForgettingRules.static_mps
"""Up to this speed nothing moves: the paper's tau_static."""
_VEHICLE = ("vehicle.parked", "vehicle.moving")
ATTRIBUTES = {
    "car": _VEHICLE,
    "truck": _VEHICLE,
    "bus": _VEHICLE,
    "bicycle": ("cycle.without_rider", "cycle.with_rider"),
    "pedestrian": ("pedestrian.standing", "pedestrian.moving"),
}
"""The attribute of what stands, and of what moves. A bicycle that moves is ridden. Of the eight
official attributes two are left out, a vehicle that only stopped and a person who sits: a box and
its speed cannot tell them.
"""


def result_boxes(shot: Shot, detections: Detections, velocities: Floats) -> list[JsonRow]:
    """The detections (n) of a keyframe as boxes of its sample, surest first, the MOST_BOXES surest
    of more.

    `velocities` (n, 2) m/s over ground, in sensor axes. In the form, places, headings and
    velocities are those of the world, sizes are width, length and height, and a rotation is a
    quaternion w, x, y, z.
    """
    scores = confidences(detections)
    # Stable: of equal scores the earlier one stays, on every machine.
    order = np.argsort(-scores, kind="stable")[:MOST_BOXES]
    world = shot.sensor.boxes_to_world(detections.boxes)
    moves = turned(velocities, shot.sensor.yaw)
    columns = zip(
        detections.classes[order].tolist(),
        world[order],
        moves[order],
        scores[order].tolist(),
        strict=True,
    )
    return [{"sample_token": shot.token, **_box(CLASSES[label], *rest)} for label, *rest in columns]


def confidences(detections: Detections) -> Floats:
    """(n,) the detector's own scores. For a detector without scores n / (n + MIN_RETURNS) of n
    returns: a half if an object just counts, towards 1 with more returns. It is never 0, which the
    devkit reads as a recall that was not reached.
    """
    if detections.scores is not None:
        return detections.scores
    scores: Floats = detections.returns / (detections.returns + MIN_RETURNS)
    return scores


def attribute(name: str, speed_mps: float) -> str:
    """The official attribute of a class at a speed over ground."""
    standing, moving = ATTRIBUTES[name]
    return moving if speed_mps > STANDING_MPS else standing


def _box(name: str, box: Floats, velocity: Floats, score: float) -> JsonRow:
    x, y, z, length, width, height, yaw = box.tolist()
    return {
        "translation": [x, y, z],
        "size": [width, length, height],
        # A turn by yaw about z.
        "rotation": [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))],
        "velocity": velocity.tolist(),
        "detection_name": name,
        "detection_score": score,
        "attribute_name": attribute(name, float(np.hypot(*velocity))),
    }
