"""Bullet asked more exactly, and whether a micrometre decides an answer.

Bullet finds surfaces by iteration and stops within 0.001 units of length. With metres, it widens
round parts and edges by 1 mm, and moves surfaces that a ray grazes by more. Told every length in
millimetres, it stops within a micrometre.
"""

from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.sensors.engines import ENGINES, Bullet
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.body_tables import SHAPES
from care_sim.world.bullet import NO_BODY, BulletWorld

SAME_RANGE_M = 0.001
"""Ranges this close are the same."""
GRAZE_M = 1e-6
"""A ray this close to where the answer changes grazes an edge."""
MM = 1000.0
METRES_TO_MM = np.array([MM, MM, MM, 1.0, 1.0, 1.0, 1.0])
"""For a pose: a position and a quaternion."""
EXACT = "bullet in millimetres"
SIDES = np.array([side for side in product((-1.0, 0.0, 1.0), repeat=3) if any(side)])
NUDGES = GRAZE_M * Rotation.from_rotvec((0.3, 0.5, 0.7)).apply(
    SIDES / np.linalg.norm(SIDES, axis=1, keepdims=True)
)
"""(26, 3) metres, towards the faces, edges and corners of a cube. They are turned, so that none
lies along an axis: an error in one place alone, as where a body is exactly overhead, is no edge.
"""


class Engines(NamedTuple):
    """The engine in question, the reference, and the reference asked in millimetres, over the same
    bodies.
    """

    fast: Any
    bullet: Any
    exact: Any

    @classmethod
    def of(cls, world, grid):
        """Over the bodies of a world; `exact` has to be closed."""
        return cls(ENGINES["fast"](world, grid), ENGINES["bullet"](world, grid), Exact(world, grid))


class Exact(Bullet):
    """Rays at the bodies of a world where they are now, asked in millimetres over a copy of them;
    pictures as Bullet draws them.
    """

    def __init__(self, world, grid):
        super().__init__(world, grid)
        self.far_grid = replace(grid, range_m=MM * grid.range_m)
        self.copy = BulletWorld()
        self.count = 0

    def cast(self, sensor, cells):
        known = self._world.primitives
        # The copy is made at the first cast, and anew where bodies were added since.
        if self.count != len(known.poses):
            self.close()
            self._copy(known)
        poses = self.copy.primitives.poses.copy()
        poses[1 : len(self.bodies) + 1] = known.poses[self.bodies] * METRES_TO_MM
        far = replace(sensor, x=MM * sensor.x, y=MM * sensor.y, z=MM * sensor.z)
        with self.copy.placed(poses):
            ranges, ids = self.rays.cast(far, cells)
        return ranges / MM, self.names[ids]

    def _copy(self, known):
        """Copy the bodies that rays can meet: the car itself is none."""
        shapes, halves, offsets, owners = known.tables
        self.count = len(known.poses)
        self.bodies = np.unique(owners)
        # The road is body 0 in both, and no body is the last of the list, by its number -1.
        self.names = np.array([0, *self.bodies, NO_BODY])
        self.copy = BulletWorld()
        for body in self.bodies:
            parts = tuple(
                Part(SHAPES[shapes[n]], (*2 * MM * halves[n],), (*MM * offsets[n],), (0.5,) * 3)
                for n in np.flatnonzero(owners == body)
            )
            self.copy.add(BodyKind("body", None, (MM,) * 3, parts), (0.0, 0.0, 0.0))
        self.rays = Bullet(self.copy, self.far_grid)

    def close(self):
        self.copy.close()


@contextmanager
def exact_engine():
    """Register Bullet in millimetres as an engine while this lasts; its name."""
    made = []

    def make(world, grid):
        made.append(Exact(world, grid))
        return made[-1]

    ENGINES[EXACT] = make
    try:
        yield EXACT
    finally:
        del ENGINES[EXACT]
        for engine in made:
            engine.close()


def same(one, other):
    """(n,) which of the answers, ranges and body ids, name the same body, ranges within
    `SAME_RANGE_M`.
    """
    return (one[1] == other[1]) & np.isclose(one[0], other[0], rtol=0.0, atol=SAME_RANGE_M)


def decided_by_a_micrometre(engine, sensor, cell, answer):
    """Whether `engine` gives `answer`, of one ray, to any of 26 rays beside that of `cell`, which
    start a micrometre from it.
    """
    places = (sensor.origin + NUDGES).tolist()
    return any(
        same(engine.cast(replace(sensor, x=x, y=y, z=z), np.array([cell])), answer).item()
        for x, y, z in places
    )
