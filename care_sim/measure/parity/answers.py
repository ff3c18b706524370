"""What engines answer to the same rays, and whether a micrometre decides an answer.

Bullet finds surfaces by iteration and stops within 0.001 units of length. With metres, it widens
round parts and edges by 1 mm, and moves surfaces that a ray grazes by more. Told every length in
millimetres, it stops within a micrometre.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.sensors.engines import RayEngine
from care_sim.sensors.engines.bullet import Bullet
from care_sim.world.bodies import BodyKind, Triple
from care_sim.world.bullet import BulletWorld

Answers = tuple[Floats, Integers]
"""Ranges (n,) in metres and body ids (n,) of n rays, as a `care_sim.sensors.engines.RayEngine`
answers.
"""

SAME_RANGE_M = 0.001
"""Ranges this close are the same."""
_GRAZE_M = 1e-6
"""A ray this close to where the answer changes grazes an edge."""
_MM = 1000.0

_SIDES = np.array([side for side in product((-1.0, 0.0, 1.0), repeat=3) if any(side)])
_NUDGES = _GRAZE_M * Rotation.from_rotvec((0.3, 0.5, 0.7)).apply(
    _SIDES / np.linalg.norm(_SIDES, axis=1, keepdims=True)
)
"""(26, 3) metres, towards the faces, edges and corners of a cube. They are turned, so that none
lies along an axis: an error in one place alone, as where a body is exactly overhead, is no edge.
"""


class Millimetres:
    """Bullet asked more exactly: over a world of its own, in millimetres, with the same bodies and
    ids from 1.
    """

    def __init__(self, kinds: Sequence[BodyKind], grid: AngularGrid):
        self._world = BulletWorld()
        self._bodies = [self._world.add(_enlarged(kind), (0.0, 0.0, 0.0)) for kind in kinds]
        self._rays = Bullet(self._world, replace(grid, range_m=_MM * grid.range_m))

    def place(self, frames: Sequence[Frame]) -> None:
        """Move all bodies; the frames are in metres."""
        for body, frame in zip(self._bodies, frames, strict=True):
            self._world.move(body, _far(frame))

    def cast(self, sensor: Frame, cells: Cells) -> Answers:
        """Ranges in metres, and body ids; see `care_sim.sensors.engines.RayEngine`."""
        ranges, ids = self._rays.cast(_far(sensor), cells)
        return ranges / _MM, ids

    def close(self) -> None:
        """Free the world."""
        self._world.close()


def same(one: Answers, other: Answers) -> Mask:
    """(n,) which rays meet the same body, ranges within `SAME_RANGE_M`."""
    alike: Mask = (one[1] == other[1]) & np.isclose(one[0], other[0], rtol=0.0, atol=SAME_RANGE_M)
    return alike


def decided_by_a_micrometre(engine: RayEngine, sensor: Frame, cell: int, answer: Answers) -> bool:
    """Whether `engine` gives `answer`, of one ray, to any of 26 rays beside that of `cell`, which
    start a micrometre from it.
    """
    cells = np.array([cell])
    places = (sensor.origin + _NUDGES).tolist()
    return any(
        same(engine.cast(replace(sensor, x=x, y=y, z=z), cells), answer).item()
        for x, y, z in places
    )


def _far(frame: Frame) -> Frame:
    return replace(frame, x=_MM * frame.x, y=_MM * frame.y, z=_MM * frame.z)


def _enlarged(kind: BodyKind) -> BodyKind:
    parts = tuple(
        replace(part, size=_longer(part.size), centre=_longer(part.centre)) for part in kind.parts
    )
    return replace(kind, size=_longer(kind.size), parts=parts)


def _longer(triple: Triple) -> Triple:
    x, y, z = triple
    return _MM * x, _MM * y, _MM * z
