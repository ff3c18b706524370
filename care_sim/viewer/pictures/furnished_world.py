"""A copy of the world for pictures, with ground, the car and marks on its path. The world of the
episode is not touched.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.loops.watcher import way_ahead
from care_sim.world.bodies import BodyKind, Part, Triple
from care_sim.world.bullet import BulletWorld
from care_sim.world.world import World

METRE_MARKS = (10.0, 20.0, 30.0, 40.0)
"""Distances ahead of the LiDAR at which the path carries a bar, metres."""

BENDING_PIECES = 40
OVERLAP = 1.3
"""Pieces of a bending path, and the factor of their length against cracks on the outside of a
bend.
"""

_REACH_M = 110.0
"""Distance beyond which bodies are left out: they are a few pixels high, and every body costs
time.
"""

_ASPHALT = (0.36, 0.36, 0.38)
_PATH = (0.47, 0.47, 0.5)
_BAR = (0.8, 0.8, 0.78)
_SKY = (128, 147, 166)
"""Dark enough for words."""
_ROAD = (85, 85, 90)
"""The asphalt, as it is painted."""
_NOTHING = 255
"""Colour that the renderer paints where no body is."""


@contextmanager
def furnished(world: World) -> Iterator[BulletWorld]:
    """Yield a simulator with every actor in sight at its present pose and an asphalt ground; freed
    at the end.
    """
    scene = BulletWorld()
    try:
        scene.add(_slab("asphalt", (400.0, 100.0, 0.2), -0.1, _ASPHALT), world.ego.pose)
        x, y, _ = world.ego.pose
        for actor in world.actors:
            pose = actor.pose_at(world.time)
            if np.hypot(pose[0] - x, pose[1] - y) < _REACH_M + actor.kind.size[0] / 2:
                scene.add(actor.kind, pose)
        yield scene
    finally:
        scene.close()


def photograph(scene: BulletWorld, camera: PinholeCamera, sensor: Frame) -> Image.Image:
    """Return the picture of a camera on a sensor at the frame `sensor`, with sky and road behind
    it.
    """
    view = scene.colours(camera, sensor)
    empty = (view == _NOTHING).all(axis=2)
    return Image.fromarray(np.where(empty[..., None], backdrop(camera), view))


def backdrop(camera: PinholeCamera) -> NDArray[np.uint8]:
    """(H, W, 3) sky above the middle of the picture, road below."""
    picture = np.full((camera.height, camera.width, 3), _ROAD, np.uint8)
    picture[: camera.height // 2] = _SKY
    return picture


def add_car(scene: BulletWorld, world: World, sensor_x: float, guarded_m: float) -> None:
    """Add the car and, on the ground, the strip that the driver guards, with a bar every ten
    metres.

    `sensor_x` is the place of the LiDAR ahead of the car's centre, `guarded_m` the strip's width,
    metres.
    """
    # Path and bars are 2 cm above what is below them, so that they are visible.
    reach = METRE_MARKS[-1]
    pieces = 1 if world.route is None else BENDING_PIECES
    length = reach / pieces
    size = length if pieces == 1 else length * OVERLAP, guarded_m, 0.02
    path = _slab("path", size, 0.01, _PATH)
    for piece in range(pieces):
        scene.add(path, way_ahead(world, sensor_x, (piece + 0.5) * length))
    for mark in METRE_MARKS:
        bar = _slab("bar", (0.15, guarded_m, 0.04), 0.02, _BAR)
        scene.add(bar, way_ahead(world, sensor_x, mark))
    scene.add(world.ego_kind, world.ego.pose)


def _slab(name: str, size: Triple, middle_z: float, colour: Triple) -> BodyKind:
    return BodyKind(name, None, size, (Part("box", size, (0.0, 0.0, middle_z), colour),))
