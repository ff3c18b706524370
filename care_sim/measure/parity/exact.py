"""Bullet in millimetres as an engine that episodes can be played under."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.measure.parity.answers import Answers, Millimetres
from care_sim.measure.parity.scenes import AWAY
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.engines.bullet import Bullet
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.body_tables import SHAPES, Primitives
from care_sim.world.bullet import BulletWorld

_ENGINE_NAME = "bullet in millimetres"
_UNSEEN = BodyKind(
    "unseen",
    None,
    (1.0, 1.0, 1.0),
    (Part("box", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5), (0.5, 0.5, 0.5)),),
)


class Exact(Bullet):
    """Rays at the bodies of a world where they are now, asked in millimetres; pictures as Bullet
    draws them.
    """

    def __init__(self, world: BulletWorld, grid: AngularGrid):
        super().__init__(world, grid)
        self._bodies = 0
        self._exact = Millimetres([], grid)

    def cast(self, sensor: Frame, cells: Cells) -> Answers:
        """Ranges and body ids; see `care_sim.sensors.engines.RayEngine`."""
        # The copy is made at the first cast, and anew where bodies were added since.
        known = self._world.primitives
        if self._bodies != len(known.poses):
            self.close()
            self._bodies = len(known.poses)
            self._exact = Millimetres(_kinds(known), self._grid)

        # Bodies that no ray can meet, as the car itself, are kept away.
        hit = set(known.tables[-1].tolist())
        self._exact.place(
            [_frame(known.poses[body]) if body in hit else AWAY for body in range(1, self._bodies)]
        )
        return self._exact.cast(sensor, cells)

    def close(self) -> None:
        """Free what was made for it."""
        self._exact.close()


@contextmanager
def exactly() -> Iterator[str]:
    """Register Bullet in millimetres as an engine while this lasts; its name."""
    made: list[Exact] = []

    def make(*arguments: Any) -> Exact:
        made.append(Exact(*arguments))
        return made[-1]

    ENGINES[_ENGINE_NAME] = make
    try:
        yield _ENGINE_NAME
    finally:
        del ENGINES[_ENGINE_NAME]
        for engine in made:
            engine.close()


def _kinds(known: Primitives) -> list[BodyKind]:
    """The bodies from id 1 on, with the primitives that rays can meet."""
    owners = known.tables[-1]
    return [_kind(known, np.flatnonzero(owners == body)) for body in range(1, len(known.poses))]


def _kind(known: Primitives, rows: Integers) -> BodyKind:
    shapes, halves, offsets, _ = known.tables
    parts = tuple(
        Part(SHAPES[shapes[row]], tuple(2 * halves[row]), tuple(offsets[row]), (0.5, 0.5, 0.5))
        for row in rows.tolist()
    )
    return BodyKind("body", None, (1.0, 1.0, 1.0), parts) if parts else _UNSEEN


def _frame(pose: Floats) -> Frame:
    return Frame.turned_by(Rotation.from_quat(pose[3:]), pose[:3])
