"""Films of annotated boxes: the boxes as bodies of a world, their sensor data, and the car's own
motion.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from care_sim.base.checks import as_array, check_known
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import FULL_TURN, Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import CLASSES, Ego
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sensors.engines import make_engine
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sensors.surround import (
    SURROUND_CAMERAS,
    View,
    full_sweep,
    numbers_of,
    surround_detections,
)
from care_sim.sources.film_checks import (
    AWAY_M,
    LEAST_KEYFRAMES,
    MAP_M,
    SIZES_M,
    STAMPS_NS,
    ValueRange,
    check_film,
    check_span,
    report_other_frame,
)
from care_sim.world.bodies import sized
from care_sim.world.bullet import BulletWorld

SPAN_S = 0.5
"""Span of earlier poses that count: a keyframe. At 10 Hz these are six poses, which average out the
centimetres of error of recorded poses. Longer spans lag behind a driver who begins to brake.
"""
TIMES_S: ValueRange = (-1e8, STAMPS_NS[1] / 1e9)
"""Seconds of a keyframe, until 2116. Milliseconds since 1970 are larger."""
STAMP_S = 1e8
"""From so large a first time on, times are rounded to microseconds after it."""
LEAST_POSES = 3
"""The fewest poses that give a steady acceleration without lag. At 2 Hz they reach back a
second.
"""


def motions(times_s: Floats, poses: Sequence[Frame]) -> list[Ego]:
    """Return the car's motion at every pose: speed along its heading, yaw rate, acceleration.

    Each motion is fitted to its pose and to earlier ones, never to later ones. Parabolas are fitted
    to places and headings of the last SPAN_S. `times_s` (n,) ascend strictly. The second pose has a
    speed and a yaw rate, but no acceleration. The first pose has no past, so its motion is zero.
    """
    # Headings that jump by a whole turn would be read as a spin.
    yaws = np.unwrap([pose.yaw for pose in poses])
    places = np.array([[pose.x, pose.y, yaw] for pose, yaw in zip(poses, yaws, strict=True)])
    return [_motion(times_s, places, pose) for pose in range(len(poses))]


def _motion(times_s: Floats, places: Floats, now: int) -> Ego:
    """Return the motion at row `now` of `places` (n, 3: x, y, heading)."""
    if now == 0:
        return Ego()
    # The span, 1% longer so that a pose at its very end counts whatever the clock's rounding; at
    # least LEAST_POSES, where there are so many.
    first = min(
        int(np.searchsorted(times_s, times_s[now] - 1.01 * SPAN_S)), max(now + 1 - LEAST_POSES, 0)
    )
    window = slice(first, now + 1)
    # Relative to now: the coefficients of the parabola are then place, rate and half the change of
    # the rate at this very moment.
    times = times_s[window] - times_s[now]
    degree = min(len(times), LEAST_POSES) - 1
    rates = np.polynomial.polynomial.polyfit(times, places[window] - places[now], degree)
    heading = np.array([np.cos(places[now, 2]), np.sin(places[now, 2])])
    acceleration = 2 * rates[2, :2] @ heading if degree == 2 else 0.0
    return Ego(float(rates[1, :2] @ heading), float(rates[1, 2]), float(acceleration))


@dataclass(frozen=True)
class AnnotatedBody:
    """An annotated box: its `number` in the film, its class name (None outside the five classes),
    length, width and height, and the frame in its centre, seen from the sensor.
    """

    number: int
    label: str | None
    size: tuple[float, float, float]
    frame: Frame

    @property
    def box(self) -> tuple[float, ...]:
        """Centre, size and heading in the sensor frame."""
        return (*self.frame.origin.tolist(), *self.size, self.frame.yaw)

    @property
    def bounds(self) -> tuple[float, ...]:
        """The box along the sensor's axes that holds it, however it is turned."""
        # Each of its own axes reaches along a sensor's axis by the absolute value of their cosine.
        extents = np.abs(self.frame.rotation.as_matrix()) @ self.size
        return (*self.frame.origin.tolist(), *extents.tolist(), 0.0)

    @property
    def foot(self) -> Frame:
        """The frame in the middle of its bottom face."""
        return self.frame.holding(np.array([0.0, 0.0, -self.size[2] / 2]))


def sense(
    annotated: Sequence[AnnotatedBody],
    sensor: Frame,
    height_m: float,
    grid: Grid,
    cameras: tuple[PinholeCamera, ...] = SURROUND_CAMERAS,
    views: Sequence[View] | None = None,
    up: Floats | None = None,
) -> tuple[Annotations, IdentifiedDetections, Cloud]:
    """Return what LiDARs in the frame `sensor` and its `cameras` see of `annotated`, every cell
    fired. `views` are the pictures of cameras that took them at other moments, in their place.

    The road is a plane `height_m` below the sensor, parallel to the car: at a right angle to `up`
    (3,) in the sensor frame, or to the sensor's z axis. It hides nothing, because real roads
    undulate: a plane in the world would bury what stands where they fall.
    """
    reported = [one for one in annotated if one.label is not None]
    annotations = annotations_of(reported)
    with closing(BulletWorld(ground=False)) as world:
        # All of them occlude. Bodies of the five classes have a number in the film.
        bodies = {id(one): _add(world, one, sensor) for one in annotated}
        numbers = {bodies[id(one)]: one.number for one in reported}
        labels = {bodies[id(one)]: CLASSES.index(str(one.label)) for one in reported}
        # A recorded sensor leans, and an upright box does not hold the body that leans back in it.
        shown = annotations.boxes if views is None else _table([one.bounds for one in reported])
        views = [View(camera, sensor) for camera in cameras] if views is None else views
        seen = surround_detections(make_engine("bullet", world, grid), views, sensor, labels, shown)
        bounds = _table([one.bounds for one in annotated])
        swept = full_sweep(world, grid, sensor, bounds, height_m, up)
    identified = IdentifiedDetections(seen.detections, numbers_of(seen.objects, numbers))
    return annotations, identified, replace(swept, objects=numbers_of(swept.objects, numbers))


def annotations_of(annotated: Sequence[AnnotatedBody]) -> Annotations:
    """The annotations of `annotated`, all of the five classes."""
    boxes = _table([one.box for one in annotated])
    classes = [CLASSES.index(str(one.label)) for one in annotated]
    numbers = [one.number for one in annotated]
    return Annotations(np.array(numbers, dtype=np.int64), np.array(classes, dtype=np.int64), boxes)


def _table(boxes: list[tuple[float, ...]]) -> Floats:
    return np.array(boxes, dtype=float).reshape(-1, 7)


def _add(world: BulletWorld, one: AnnotatedBody, sensor: Frame) -> int:
    foot = one.foot
    return world.add(sized("prop", one.label, one.size), sensor.holding(foot.origin, foot.rotation))


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

    - `times_s` (k,): seconds at the keyframes, ascending, about evenly apart, from any moment on,
      such as 1970.
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
    times = _numbers(f"{name}: times_s (seconds)", times_s, (-1,), TIMES_S)
    # A float holds a time since 1970 to 0.2 us only. Keyframes 0.5 s apart stay 0.5 s apart.
    if len(times) and times[0] >= STAMP_S:
        times = np.round(times - times[0], 6)
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
    report_other_frame(name, given)
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
    if not isinstance(box["id"], str | int | np.integer):
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
