"""A copy of the world for pictures that people look at, with ground, the car and marks on its path.

The world of the episode is not touched.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from care_sim.core.pinhole import PinholeCamera
from care_sim.world.bodies import BodyKind, Part, Triple
from care_sim.world.bullet import BulletWorld
from care_sim.world.world import World

CHASE_SIZE = (960, 460)
CHASE_CAMERA = PinholeCamera(
    *CHASE_SIZE, np.deg2rad(80.0), (-10.0, 0.0, 3.6), 0.0, np.deg2rad(-16.0)
)
"""Behind the car and above it, in the frame of the LiDAR; low enough for a strip of sky."""

METRE_MARKS = (10.0, 20.0, 30.0, 40.0)
"""Distances ahead of the LiDAR at which the path carries a bar, metres."""

_ASPHALT = (0.36, 0.36, 0.38)
_PATH = (0.47, 0.47, 0.5)
_BAR = (0.8, 0.8, 0.78)


@contextmanager
def furnished(world: World) -> Iterator[BulletWorld]:
    """A simulator with every actor at its present pose and an asphalt ground; freed at the end."""
    scene = BulletWorld()
    try:
        scene.add(_slab("asphalt", (400.0, 100.0, 0.2), -0.1, _ASPHALT), world.ego.pose)
        for actor in world.actors:
            scene.add(actor.kind, actor.pose_at(world.time))
        yield scene
    finally:
        scene.close()


def add_car(scene: BulletWorld, world: World, sensor_x: float, guarded_m: float) -> None:
    """Add the car and, on the ground, the strip that the driver guards, with a bar every ten
    metres.

    `sensor_x` is the place of the LiDAR ahead of the car's centre, `guarded_m` the strip's width,
    metres.
    """
    # Path and bars stand 2 cm over what is below them, so that they are what is seen.
    x, y, yaw = world.ego.pose
    for kind, ahead in (
        (_slab("path", (METRE_MARKS[-1], guarded_m, 0.02), 0.01, _PATH), METRE_MARKS[-1] / 2),
        *((_slab("bar", (0.15, guarded_m, 0.04), 0.02, _BAR), mark) for mark in METRE_MARKS),
    ):
        reach = sensor_x + ahead
        scene.add(kind, (x + reach * float(np.cos(yaw)), y + reach * float(np.sin(yaw)), yaw))
    scene.add(world.ego_kind, world.ego.pose)


def _slab(name: str, size: Triple, middle_z: float, colour: Triple) -> BodyKind:
    return BodyKind(name, None, size, (Part("box", size, (0.0, 0.0, middle_z), colour),))
