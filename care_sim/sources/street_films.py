"""The film of a street: at every keyframe the whole grid is cast once, and six cameras are
rendered.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import secret_entropy
from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import RAYS, STRONGEST, FilmedReturns
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import CLASSES, Scan
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import NO_OBJECT, Annotations, Cloud, IdentifiedDetections, cloud_of
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import make_engine
from care_sim.sensors.recorded_errors import add_recorded_losses, slopes
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sensors.signal import Signal
from care_sim.sensors.surround import (
    SURROUND_CAMERAS,
    View,
    full_sweep,
    numbers_of,
    surround_detections,
)
from care_sim.streets.draft import STREET_KEYFRAME_S
from care_sim.streets.street import Street, make_street
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import BulletWorld
from care_sim.world.bullet_bodies import MOST_PARTS
from care_sim.world.motions import LinearMotion, rates_between

SIGHT_M = 60.0
"""Bodies with a farther hull are left out, unless the LiDAR reaches farther. The default one
reaches 50 m, and an adult at about 50 m has the least number of camera pixels.
"""

_DEFAULT = sensor_setup(DEFAULT_SETUP)
_ENGINE = "bullet"
"""Engine of every film, so that films differ only by their settings."""
_CLUTTER_ENGINE = "fast"
"""Engine of cluttered streets: with their thousands of parts Bullet and its pictures take ten times
as long. Both engines agree (`make parity`).
"""
SUNK_M = 1000.0
"""Depth below the road of bodies that rays ignore: no LiDAR reaches there."""
_NO_CLASS = -1
"""The class of a body that the five classes do not hold."""


def record(street: Street, setup: SensorSetup = _DEFAULT, returns: FilmedReturns = RAYS) -> Film:
    """Return the film of a street, taken by a sensor set-up with the return model `returns`. The
    columns of `street.poses` are `Cloud.objects` and `Annotations.objects`.

    An object is annotated at a keyframe if a return of the full sweep lies on it or a camera shows
    it. Similarly nuScenes scores objects with at least one LiDAR or radar point. Wholly hidden
    objects cannot be seen. Objects hidden at the first keyframe are in `Film.hidden`. The
    annotations do not depend on the return model: they hold the objects that plain rays or a camera
    meet. Raises InvalidInput for a pose that is not finite.
    """
    check_filmed(returns)
    columns = [f"{kind} (column {number})" for number, kind in enumerate(street.kinds)]
    _check_poses(street, ["the ego"], street.ego[:, None])
    _check_poses(street, columns, street.poses)
    cameras = setup.equipped(SURROUND_CAMERAS)
    with closing(BulletWorld()) as world:
        bodies = _StreetBodies(street, world, setup, returns)
        shots, hidden = zip(*(bodies.shot(k, cameras) for k in range(len(street.ego))), strict=True)
    x, y, z = setup.position
    told = street.name, cameras, z, STREET_KEYFRAME_S
    return Film(*told, shots, hidden[0], setup.grid, (x, y), returns=returns, kerbs=street.kerbs)


def _check_poses(street: Street, names: Sequence[str], poses: Floats) -> None:
    """Raise InvalidInput for the first of the `poses` (k, n, 3) that is not finite."""
    lost = np.argwhere(~np.isfinite(poses))
    if len(lost):
        keyframe, body, _ = lost[0].tolist()
        place = ", ".join(f"{number:g}" for number in poses[keyframe, body])
        raise InvalidInput(
            f"street {street.name}: the pose of {names[body]} is {place} at "
            f"{keyframe * STREET_KEYFRAME_S:g} s; x, y and heading must be finite numbers"
        )


def check_filmed(returns: FilmedReturns) -> None:
    """Raise InvalidInput if one film cannot serve every number of shots: the last echo depends on
    the number of noticed ones, the strongest does not.
    """
    if returns.most_shots > 1 and returns.lidar_returns != STRONGEST:
        raise InvalidInput(
            f"lidar_returns must be {STRONGEST} on a street whose cells may be fired several "
            f"times (firing energy with lidar_stated_range_m), got {returns.lidar_returns}"
        )


def street_film(
    seed: int, secret: str = "", setup: SensorSetup = _DEFAULT, returns: FilmedReturns = RAYS
) -> Film:
    """The film of the street of a seed. The last one is kept, for policies that meet the same
    street in turn. With a secret it is another street, whose seed cannot be guessed. Its name
    tells the given seed, and not the layout.
    """
    return _street_film(seed, secret, setup, returns)


@lru_cache(maxsize=1)
def _street_film(seed: int, secret: str, setup: SensorSetup, returns: FilmedReturns) -> Film:
    if not secret:
        return record(make_street(seed, returns.clutter), setup, returns)
    street = make_street(secret_entropy("street", (seed,), secret), returns.clutter)
    return record(replace(street, name=f"street-{seed:04d}-secret"), setup, returns)


class _StreetBodies:
    """The bodies of a street in a simulator. Each enters when it first comes near, then follows its
    way.
    """

    def __init__(
        self, street: Street, world: BulletWorld, setup: SensorSetup, returns: FilmedReturns
    ):
        self._returns = returns
        self._street = street
        self._world = world
        self._setup = setup
        # No ray meets a body that is farther than the LiDAR reaches.
        reaches = [head.grid.range_m + np.hypot(*head.place[:2]) for head in setup.grid.heads]
        self._sight_m = max(SIGHT_M, *reaches)
        self._sizes = np.array([CATALOGUE[kind].size for kind in street.kinds]).reshape(-1, 3)
        labels = [CATALOGUE[kind].label for kind in street.kinds]
        self._classes = np.array(
            [_NO_CLASS if label is None else CLASSES.index(label) for label in labels], np.int64
        )
        self._bodies: dict[int, int] = {}
        self._engine_name = _CLUTTER_ENGINE if returns.clutter else _ENGINE
        self._engine = make_engine(self._engine_name, world, setup.grid)
        self._clutter = [*street.clutter]
        # Only the street decides, so that every policy meets the same losses.
        self._rng = np.random.default_rng(int(street.digest()[:16], 16))
        self._bright = self._rng.uniform(-1.0, 1.0, len(street.kinds))
        level = np.zeros((len(street.ego), 2))
        self._slopes = slopes(street.ego, self._rng) if returns.clutter else level

    def shot(self, keyframe: int, cameras: tuple[PinholeCamera, ...]) -> tuple[Shot, Annotations]:
        """Return everything visible at a keyframe, and the near hidden objects."""
        street = self._street
        x, y, yaw = street.ego[keyframe].tolist()
        pitch, roll = self._slopes[keyframe].tolist()
        sensor = Frame.mounted((x, y, yaw), self._setup.position)
        sensor = replace(sensor, pitch=pitch, roll=roll)
        near = self._set_up(keyframe, sensor)
        # Everything near may hide something; what has a class is reported and annotated.
        everything = sensor.boxes_to_local(self._boxes(keyframe, near))
        reported = self._classes[near] != _NO_CLASS
        labelled = near[reported]
        boxes = everything[reported]
        self._strew(sensor)
        numbers = {self._bodies[number]: number for number in labelled.tolist()}
        labels = {body: int(self._classes[number]) for body, number in numbers.items()}
        views = [View(camera, sensor) for camera in cameras]
        seen = surround_detections(self._engine, views, sensor, labels, boxes)
        swept = self._swept(sensor, everything)
        identified = IdentifiedDetections(seen.detections, numbers_of(seen.objects, numbers))
        cloud = replace(swept, objects=numbers_of(swept.objects, numbers))
        # Seen by the full sweep or by a camera, whatever a policy will fire later.
        shown = np.isin(labelled, np.concatenate([cloud.objects, identified.objects]))
        if self._returns.shapes_beams:
            every = np.arange(self._setup.grid.size)
            cloud = self._returned(keyframe, sensor, every, numbers)
        if self._returns.clutter:
            objects = self._classes, self._bright
            behind = partial(self._behind, keyframe, sensor, numbers)
            cloud = add_recorded_losses(cloud, self._setup.grid, objects, behind, self._rng)
        annotations, hidden = (
            Annotations(labelled[kept], self._classes[labelled[kept]], boxes[kept])
            for kept in (shown, ~shown)
        )
        token = f"{street.name}/{keyframe:02d}"
        motion = street.motion[keyframe]
        return Shot(
            keyframe * STREET_KEYFRAME_S, token, sensor, motion, annotations, identified, cloud
        ), hidden

    def _swept(self, sensor: Frame, boxes: Floats) -> Cloud:
        """Return what plain rays meet, by body; `boxes` (n, 7) hold all bodies but clutter."""
        grid = self._setup.grid
        if not self._returns.clutter:
            return full_sweep(self._world, grid, sensor, boxes, sensor.z)
        # Clutter is everywhere, and the road slopes: every ray is cast, at the road too.
        cells = np.arange(grid.size)
        ranges, bodies = self._engine.cast(sensor, cells)
        return cloud_of(Scan(cells, ranges), bodies, grid)

    def _behind(
        self, keyframe: int, sensor: Frame, numbers: Mapping[int, int], cells: Cells
    ) -> Cloud:
        """Return the cloud of the cells that pass by the reported bodies, those of `numbers`."""
        poses = self._world.primitives.poses.copy()
        poses[[*numbers], 2] -= SUNK_M
        with self._world.placed(poses):
            if self._returns.shapes_beams:
                return self._returned(keyframe, sensor, cells, numbers)
            ranges, _ = self._engine.cast(sensor, cells)
        nobody = np.full(len(cells), NO_OBJECT)
        return cloud_of(Scan(cells, ranges), nobody, self._setup.grid)

    def _returned(
        self, keyframe: int, sensor: Frame, cells: Cells, numbers: Mapping[int, int]
    ) -> Cloud:
        """The returns of cells; `numbers` are those of the bodies that are reported."""
        grid = self._setup.grid
        moving = partial(self._motion, keyframe)
        beams = Beams(self._world, grid, self._returns, self._engine_name, moving)
        most = self._returns.most_shots
        scan, bodies = beams.cast(sensor, cells, np.full(grid.size, most))
        told = beams.compensated(scan, sensor)
        cloud = cloud_of(told, numbers_of(bodies, numbers), grid)
        if most == 1 or scan.intensities is None:
            return cloud
        needed = Signal(self._returns).shots_needed(scan.intensities, scan.ranges)
        return replace(cloud, shots=needed[np.isfinite(scan.ranges)])

    def _motion(self, keyframe: int) -> LinearMotion:
        """How everything moved since the keyframe before; at the first, until the next."""
        street = self._street
        last, coming = max(keyframe, 1) - 1, max(keyframe, 1)
        ways = rates_between(street.poses[last], street.poses[coming], STREET_KEYFRAME_S)
        own = rates_between(street.ego[[last]], street.ego[[coming]], STREET_KEYFRAME_S)
        rates = np.zeros((len(self._world.primitives.poses), 3))
        rates[[*self._bodies.values()]] = ways[[*self._bodies]]
        x, y, yaw = street.ego[keyframe].tolist()
        return LinearMotion((x, y, yaw), own[0], rates)

    def _set_up(self, keyframe: int, sensor: Frame) -> Integers:
        """Put every body that is near where it is now. Returns their numbers, ascending."""
        poses = self._street.poses[keyframe]
        # From the sensor to the circle round the footprint, which holds it however it is turned.
        apart = (
            np.hypot(poses[:, 0] - sensor.x, poses[:, 1] - sensor.y)
            - np.hypot(*self._sizes[:, :2].T) / 2
        )
        (near,) = np.nonzero(apart < self._sight_m)
        # Bodies that were near once stay in the world and are moved on; those that stand need not
        # be.
        placed = np.array([*self._bodies], np.int64)
        moved = placed[np.any(poses[placed] != self._street.poses[keyframe - 1, placed], axis=1)]
        self._world.move_all(
            np.array([self._bodies[number] for number in moved.tolist()], np.int64), poses[moved]
        )
        for number in set(near.tolist()) - set(self._bodies):
            x, y, yaw = poses[number].tolist()
            self._bodies[number] = self._world.add(
                CATALOGUE[self._street.kinds[number]], (x, y, yaw)
            )
        return near

    def _strew(self, sensor: Frame) -> None:
        """Let clutter in that has come near. Clutter that was near once stays."""
        waiting = []
        for kind, pose in self._clutter:
            x, y, _ = pose
            if np.hypot(x - sensor.x, y - sensor.y) > self._sight_m:
                waiting.append((kind, pose))
                continue
            for start in range(0, len(kind.parts), MOST_PARTS):
                some = replace(kind, parts=kind.parts[start : start + MOST_PARTS])
                self._world.add(some, pose)
        self._clutter = waiting

    def _boxes(self, keyframe: int, numbers: Integers) -> Floats:
        """(n, 7) world boxes of bodies by number."""
        x, y, yaw = self._street.poses[keyframe, numbers].T
        return np.column_stack([x, y, self._sizes[numbers, 2] / 2, self._sizes[numbers], yaw])
