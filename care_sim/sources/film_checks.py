"""Bounds of a recording's values, the same for every source, and the description of a film.

The ranges are wide, and values beyond them are damage. Later they would become infinities and NaN,
or a body that crashes Bullet (such as a round one without a radius).
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput, report_problems, shown
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.frames import FULL_TURN, Frame
from care_sim.core.types import CLASSES
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, Cloud

ValueRange = tuple[float, float]

SIZES_M: ValueRange = (0.01, 200.0)
"""Length, width and height of an annotated box: a tenth of the smallest, and twice the longest
train in a street.
"""
AWAY_M: ValueRange = (-1e4, 1e4)
"""x, y and z of an annotated box from the car: forty times as far as boxes are annotated."""
MAP_M: ValueRange = (-1e8, 1e8)
"""x, y and z in a map: more than twice round the Earth, and yet a float tells a micrometre."""
MOUNT_M: ValueRange = (-100.0, 100.0)
"""x, y and z of a sensor in its car, which may be a road train."""
REACH_M: ValueRange = (-500.0, 500.0)
"""x, y and z of a point from its sensor: farther than any LiDAR reaches."""
STAMPS_NS: ValueRange = (0, 2**62)
"""Nanoseconds since 1970, until 2116: differences stay within 64 bits."""
LONGEST_S = 86_400
"""A drive lasts a day."""
MOST_PITCH = np.radians(80)
"""Radians that a car or a box may be pitched: what points straight up has no heading."""
UNIT = (0.9, 1.1)
"""The length of a quaternion that was rounded."""


def check_span(path: Path | str, seconds: float) -> None:
    """Raise InvalidInput for a drive longer than `LONGEST_S`."""
    if seconds > LONGEST_S:
        raise InvalidInput(
            f"{path}: its times span {seconds:g} s, and a drive may last {LONGEST_S} s"
        )


def quaternion_fault(turns: Floats, has_heading: bool = True) -> tuple[int, str] | None:
    """Return the row and the fault of the first quaternion (n, 4: x, y, z, w) without a rotation,
    or without a required heading.
    """
    # Clipped, since squares of large numbers overflow.
    lengths = np.linalg.norm(np.clip(turns, -2, 2), axis=1)
    unit = (lengths >= UNIT[0]) & (lengths <= UNIT[1])
    x, y, z, w = np.where(unit[:, None], turns, 0.0).T
    # The sine of the pitch is 2 (w y - x z) over the square of the quaternion's length.
    steep = np.abs(w * y - x * z) * 2 > np.sin(MOST_PITCH) * np.where(unit, lengths, 1.0) ** 2
    for wrong, reason in (
        (~unit, "a quaternion that is not of length 1"),
        (steep & has_heading, f"a pitch beyond {np.degrees(MOST_PITCH):.0f} degrees"),
    ):
        if wrong.any():
            return int(wrong.argmax()), reason
    return None


LEAST_KEYFRAMES = 3
"""Fewer keyframes give neither an acceleration nor a first sighting that a track follows."""
MOVES_M = 5.0
"""The car must move so far in the life of an object, or nothing is known of the object's frame."""
STILL_M = (0.3, 1.0)
"""A standing object may move a twentieth of the car's way, within these bounds: labels err."""
MOST_ASTRAY = 0.3
"""Share of the objects that a real drive may have of those which stand in another frame alone: cars
in a convoy, for example. 17 drives of KITTI, two of nuScenes, two of Argoverse 2 and one of Boreas
stay below it.
"""
_FRAMES = {
    "move along with the car": "boxes of a Film are in the frame of its LiDAR at that keyframe, "
    "not in the world's",
    "move against the car": "poses of film_of_boxes are in the world's frame, not in the car's",
}


def check_film(film: Any, recorded: bool = False) -> None:
    """Raise InvalidInput for anything but a film, or impossible content. A `recorded` film must
    annotate something.

    Print a line where most boxes seem to be given in another frame.
    """
    if not isinstance(film, Film):
        raise InvalidInput(f"film must return a Film, got {type(film).__name__}")
    if len(film.shots) < LEAST_KEYFRAMES:
        raise InvalidInput(
            f"{film.name}: a film needs at least {LEAST_KEYFRAMES} keyframes, this one has "
            f"{len(film.shots)}"
        )
    times = np.array([shot.time_s for shot in film.shots], dtype=float)
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise InvalidInput(f"{film.name}: times must ascend, got {shown(times.tolist())}")
    for shot in film.shots:
        _check_shot(film, shot)
    if recorded and not any(len(shot.annotations) for shot in film.shots):
        raise InvalidInput(f"{film.name}: no {', no '.join(CLASSES)} in any of its keyframes")
    report_other_frame(film.name, [(shot.sensor, shot.annotations) for shot in film.shots])


def report_other_frame(name: str, seen: Sequence[tuple[Frame, Annotations]]) -> None:
    """Print a line where most boxes seem to be given in another frame. `seen` are the frame of the
    LiDAR and the annotations in it, per keyframe.
    """
    if told := _other_frame(seen):
        report_once(f"{name}: its boxes {told}: {_FRAMES[told]}")


@lru_cache(maxsize=1000)
def report_once(line: str) -> None:
    """Print a line on standard error, the first time in a process."""
    report_problems([line])


def _check_shot(film: Film, shot: Shot) -> None:
    place = f"{film.name} at {shot.time_s:g} s"
    _check_car(place, shot)
    for cloud in (shot.cloud, *(sweep.cloud for sweep in shot.sweeps)):
        _check_cloud(place, cloud, film.grid.size)
    if not np.isfinite(shot.seen.detections.rows()).all():
        raise InvalidInput(f"{place}: a box of a camera is not finite")
    objects, boxes = shot.annotations.objects, shot.annotations.boxes
    if not len(objects) == len(shot.annotations.classes) == len(boxes):
        raise InvalidInput(f"{place}: objects, classes and boxes must be equally many")
    if not len(objects):
        return
    _check_boxes(place, objects, boxes, shot.sensor.yaw)
    if len(np.unique(objects)) < len(objects):
        raise InvalidInput(f"{place}: an object is annotated twice")
    if not np.isin(shot.annotations.classes, range(len(CLASSES))).all():
        raise InvalidInput(f"{place}: classes must be numbers from 0 to {len(CLASSES) - 1}")


def _check_car(place: str, shot: Shot) -> None:
    own = [shot.sensor.x, shot.sensor.y, shot.sensor.z]
    turns = [shot.sensor.yaw, shot.sensor.pitch, shot.sensor.roll]
    ego = [shot.ego.speed, shot.ego.yaw_rate, shot.ego.acceleration]
    if not np.isfinite([*own, *turns, *ego]).all():
        raise InvalidInput(f"{place}: the pose or the motion of the car is not finite")
    if np.abs(turns).max() > FULL_TURN:
        raise InvalidInput(
            f"{place}: the car is turned by {max(turns, key=abs):g}, must be radians"
        )


def _check_cloud(place: str, cloud: Cloud, cells: int) -> None:
    if not (len(cloud.cells) == len(cloud.objects) and cloud.points.shape == (len(cloud), 3)):
        raise InvalidInput(f"{place}: cells, points and objects of a cloud must be equally many")
    if not np.isfinite(cloud.points).all():
        raise InvalidInput(f"{place}: a point of a cloud is not finite")
    ascend = np.diff(cloud.cells) >= 0
    if len(cloud) and not (ascend.all() and 0 <= cloud.cells[0] <= cloud.cells[-1] < cells):
        raise InvalidInput(f"{place}: cells of a cloud must ascend, from 0 to {cells - 1}")


def _check_boxes(place: str, objects: Integers, boxes: Floats, yaw: float) -> None:
    if boxes.shape[1:] != (7,):
        raise InvalidInput(f"{place}: boxes must be (n, 7), got {boxes.shape}")
    sizes, turns = boxes[:, 3:6], boxes[:, 6]
    least, most = SIZES_M
    sized = ((sizes >= least) & (sizes <= most)).all(axis=1)
    # A source may take the difference of two headings, each of which is within a turn.
    in_radians = np.minimum(np.abs(turns), np.abs(turns + yaw)) <= FULL_TURN
    for fits, told in (
        (np.isfinite(boxes).all(axis=1), "a place, size or yaw that is not finite"),
        (sized, f"a size outside {least:g} to {most:g} m"),
        (in_radians, "a yaw beyond a full turn (radians)"),
    ):
        if not fits.all():
            row = int(fits.argmin())
            got = shown(boxes[row].tolist())
            raise InvalidInput(f"{place}: object {objects[row]} has {told}, got {got}")


def _other_frame(seen: Sequence[tuple[Frame, Annotations]]) -> str:
    """Return how the boxes move if nothing stands as told, and much would in another frame; else
    nothing. Each object counts once, by its first and its last box.
    """
    objects = np.concatenate([annotations.objects for _, annotations in seen])
    numbers = np.repeat(np.arange(len(seen)), [len(annotations) for _, annotations in seen])
    first = np.unique(objects, return_index=True)[1]
    last = len(objects) - 1 - np.unique(objects[::-1], return_index=True)[1]
    cars = np.array([sensor.origin for sensor, _ in seen])
    way = np.linalg.norm(cars[numbers[last]] - cars[numbers[first]], axis=1)
    counts = way >= MOVES_M
    if counts.sum() < 2:
        return ""
    told = [annotations.boxes for _, annotations in seen]
    world = [sensor.boxes_to_world(annotations.boxes) for sensor, annotations in seen]
    twice = [sensor.boxes_to_world(boxes) for (sensor, _), boxes in zip(seen, world, strict=True)]

    def standing(tables: list[Floats]) -> float:
        # On the ground: a LiDAR leans, and boxes tens of metres off would rise as it nears them.
        places = np.concatenate(tables)[:, :2]
        moved = np.linalg.norm(places[last] - places[first], axis=1)
        return float(np.mean((moved <= np.clip(way / 20, *STILL_M))[counts]))

    if standing(world) > 0.1:
        return ""
    others = zip(_FRAMES, (told, twice), strict=True)
    return next((name for name, boxes in others if standing(boxes) > MOST_ASTRAY), "")


def report_empty_boxes(
    name: str, every: Sequence[Annotations], filled: Sequence[Mask], range_m: float
) -> None:
    """Print once how many boxes of a scene hold no recorded point, and how many newcomers there are
    without and with them.

    `every` are all annotations per keyframe, and `filled` (n,) which of them hold a point. Boxes
    within `range_m` metres count.
    """
    near = [planar_ranges(annotations.boxes) <= range_m for annotations in every]
    objects = [part.objects[own] for part, own in zip(every, near, strict=True)]
    holds = np.concatenate([part[own] for part, own in zip(filled, near, strict=True)])
    if holds.all():
        return
    together = np.concatenate(objects)
    # Objects of the first keyframe were present, with a point or without.
    without, with_them = (
        len(np.setdiff1d(some, objects[0])) for some in (together[holds], together)
    )
    report_once(
        f"{name}: {np.sum(~holds)} of {len(holds)} boxes within {range_m:g} m hold no recorded "
        f"point: {without} newcomers without these boxes, {with_them} with them"
    )
