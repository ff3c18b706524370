"""A film of annotated boxes that somebody holds as plain numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from care_sim.base.checks import as_array, check_known
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.core.frames import Frame
from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import CLASSES
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.boxes_as_bodies import AnnotatedBody, sense
from care_sim.sources.car_motion import motions
from care_sim.sources.film_checks import FULL_TURN, LEAST_KEYFRAMES, check_film, tell_other_frame
from care_sim.sources.plausible import AWAY_M, MAP_M, SIZES_M, ValueRange, check_span


def film_of_boxes(
    name: str,
    times_s: Sequence[float],
    ego_poses: Sequence[Sequence[float]],
    boxes: Sequence[Sequence[Mapping[str, Any]]],
    sensor: str | SensorSetup = DEFAULT_SETUP,
) -> Film:
    """Make a film of boxes: they become bodies, and a sensor set-up sees them at every keyframe.

    All poses are x, y, z (metres) and yaw (radians, from x towards y) in one world frame, z up.
    Poses of the car may go on with its roll and its pitch (`care_sim.core.frames.Frame`).

    - `times_s` (k,): seconds at the keyframes, ascending, about evenly apart.
    - `ego_poses` (k, 4) or (k, 6): the pose of the car at each keyframe: the point on the road
      below its middle, x ahead, y to its left.
    - `boxes`: per keyframe a list of maps. `id` names an object throughout the film. `class` is one
      of `care_sim.CLASSES`, or None for a body that only hides others. `size` is length, width and
      height. `pose` is that of the middle of the box, in the world: neither in the car's frame nor
      in the LiDAR's.

    An object is annotated at a keyframe if a ray of the whole grid meets it or a camera shows it.

    Raises InvalidInput with scene, time and object for what no drive holds.
    """
    setup = sensor_setup(sensor)
    times = _numbers(f"{name}: times_s", times_s, (-1,), MAP_M)
    tilted = as_array(f"{name}: ego_poses", ego_poses).shape[1:] == (6,)
    poses = _numbers(f"{name}: ego_poses", ego_poses, (-1, 6 if tilted else 4), MAP_M)
    _check_list(name, boxes)
    if not LEAST_KEYFRAMES <= len(times) == len(poses) == len(boxes):
        raise InvalidInput(
            f"{name}: times_s, ego_poses and boxes must hold as many keyframes, at least "
            f"{LEAST_KEYFRAMES}, got {len(times)}, {len(poses)} and {len(boxes)}"
        )
    if (np.diff(times) <= 0).any():
        raise InvalidInput(f"{name}: times_s must ascend, got {shown(times.tolist())}")
    check_span(name, times[-1] - times[0])
    _check_turns(f"{name}: ego_poses", poses)
    # A map's coordinates lie far from their origin, so the world of a film begins at the car.
    start = np.pad(poses[0, :3], (0, poses.shape[1] - 3))
    cars = [Frame(*pose) for pose in (poses - start).tolist()]
    numbers: dict[Any, int] = {}
    shots: list[Shot] = []
    given = []
    for time_s, car, ego, seen in zip(
        (times - times[0]).tolist(), cars, motions(times, cars), boxes, strict=True
    ):
        place = f"{name} at {time_s + times[0]:g} s"
        frame = car.holding(np.array(setup.position))
        _check_list(place, seen)
        bodies = [_body(place, box, start, frame, numbers) for box in seen]
        annotations, pictures, cloud = sense(
            bodies, frame, setup.position[2], setup.grid, setup.equipped(SURROUND_CAMERAS)
        )
        given.append((frame, annotations))
        annotated = annotations.take(_is_shown(annotations, pictures, cloud))
        shots.append(Shot(time_s, f"{name}/{len(shots)}", frame, ego, annotated, pictures, cloud))
    tell_other_frame(name, given)
    first, everyone = shots[0], given[0][1]
    film = Film(
        name,
        setup.equipped(SURROUND_CAMERAS),
        setup.position[2],
        float(np.median(np.diff(times))),
        tuple(shots),
        everyone.take(~_is_shown(everyone, first.seen, first.cloud)),
        setup.grid,
        setup.position[:2],
    )
    check_film(film, recorded=True)
    return film


def _check_list(place: str, boxes: Any) -> None:
    if not isinstance(boxes, Sequence):
        raise InvalidInput(f"{place}: boxes must be a list, got {shown(boxes)}")


def _body(
    place: str, box: Any, start: Floats, sensor: Frame, numbers: dict[Any, int]
) -> AnnotatedBody:
    """Return a box as a body, seen from the sensor; a new id gets the next of the `numbers`."""
    if not (isinstance(box, Mapping) and {"id", "class", "size", "pose"} <= {*box}):
        raise InvalidInput(f"{place}: a box must have id, class, size and pose, got {shown(box)}")
    label = box["class"]
    named = f"{place}: object {shown(box['id'])}"
    if label is not None:
        check_known(f"class of {named}", label, CLASSES)
    if not isinstance(box["id"], str | int):
        raise InvalidInput(f"{named}: id must be a text or a whole number")
    length, width, height = _numbers(f"{named}: size", box["size"], (3,), SIZES_M).tolist()
    pose = _numbers(f"{named}: pose", box["pose"], (4,), MAP_M)
    _check_turns(f"{named}: pose", pose[None])
    own = sensor.seeing(Frame(*(pose - start[:4]).tolist()))
    if np.abs(own.origin).max() > AWAY_M[1]:
        raise InvalidInput(
            f"{named}: pose lies {np.abs(own.origin).max():g} m from the car, may lie "
            f"{AWAY_M[1]:g} m from it"
        )
    return AnnotatedBody(
        numbers.setdefault(box["id"], len(numbers)), label, (length, width, height), own
    )


def _numbers(name: str, value: Any, shape: tuple[int, ...], within: ValueRange) -> Floats:
    """Return `value` as finite numbers of a shape, -1 for any length; they lie `within` a range."""
    array = as_array(name, value)
    fits = array.ndim == len(shape) and all(
        wanted in (-1, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype.kind not in "iuf":
        wanted = " x ".join("n" if each < 0 else str(each) for each in shape)
        raise InvalidInput(f"{name} must be {wanted} numbers, got {shown(value)}")
    least, most = within
    if not ((array >= least) & (array <= most)).all():
        raise InvalidInput(f"{name} must lie in [{least:g}, {most:g}], got {shown(value)}")
    return array.astype(float)


def _check_turns(name: str, poses: Floats) -> None:
    for turn, angles in zip(("yaw", "roll", "pitch"), poses[:, 3:].T, strict=False):
        most = angles[np.abs(angles).argmax()]
        if abs(most) > FULL_TURN:
            raise InvalidInput(f"{name}: {turn} must be radians within a full turn, got {most:g}")


def _is_shown(annotations: Annotations, pictures: IdentifiedDetections, cloud: Cloud) -> Mask:
    """Return which objects a ray meets or a picture shows."""
    shown_there: Mask = np.isin(
        annotations.objects, np.concatenate([cloud.objects, pictures.objects])
    )
    return shown_there
