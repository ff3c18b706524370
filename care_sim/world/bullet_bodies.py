"""Bodies in PyBullet clients that are reused."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple
from weakref import finalize

import numpy as np

from care_sim.base.extras import STANDARD_ERROR, silence_output
from care_sim.core.arrays import Floats, Integers
from care_sim.world.bodies import Part

with silence_output(STANDARD_ERROR):  # where it prints its build time
    import pybullet

__all__ = ["MOST_PARTS", "LentClient", "borrow", "give_back", "leave", "pybullet"]

MOST_FREE = 4
"""Clients kept for reuse. Each holds 28 MB; a new one takes 14 ms."""

_CLOSED = -1
"""PyBullet's number for no client."""

_free: list[int] = []


class LentClient:
    """A client that is borrowed at its first use. Emptying a client takes a millisecond, and many
    worlds never need one. An unclosed client is given back with its last reference.
    """

    def __init__(self) -> None:
        self._number: int | None = None
        self._abandoned: finalize[[int], LentClient] | None = None

    @property
    def number(self) -> int:
        """Return PyBullet's number of the shape."""
        if self._number is None:
            # An unclosed client is given back at garbage collection. At the end of the process
            # there are none.
            self._number = borrow()
            self._abandoned = finalize(self, leave, self._number)
            self._abandoned.atexit = False
        return self._number

    def __getstate__(self) -> dict[str, object]:
        # Two owners of one client would empty it for each other: a copy borrows its own.
        return {"_number": _CLOSED if self.closed else None, "_abandoned": None}

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._number == _CLOSED

    def close(self) -> None:
        """Give the client back; calling it again does nothing."""
        if self._abandoned is not None and self._abandoned.detach():
            give_back(self.number)
        # From now on PyBullet refuses calls of this client.
        self._number = _CLOSED


def borrow() -> int:
    """Return an empty client. Clients that other code has closed or filled meanwhile do no harm."""
    # Clients left by finalisers are handled only here, where PyBullet may be called.
    _end_surplus()
    while (client := _next_free()) is not None:
        if pybullet.isConnected(client):
            pybullet.resetSimulation(physicsClientId=client)
            return client
    return int(pybullet.connect(pybullet.DIRECT))


def give_back(client: int) -> None:
    """Return a client to the pool."""
    leave(client)
    _end_surplus()


def leave(client: int) -> None:
    """Give a client back without calling PyBullet, as finalisers must: garbage collection may run
    within its calls.
    """
    _free.append(client)


def _next_free() -> int | None:
    # Another thread may take the last one between a look and a grasp.
    try:
        return _free.pop()
    except IndexError:
        return None


def _end_surplus() -> None:
    while len(_free) > MOST_FREE and (client := _next_free()) is not None:
        if pybullet.isConnected(client):
            pybullet.disconnect(client)


NO_BODY = -1
"""The id for no body, ours and PyBullet's."""
OPAQUE, TRANSPARENT = 1, 2
"""Groups of bodies that rays hit, and that they pass."""

MOST_PARTS = 16
"""Most parts of one body: PyBullet crashes on more (`MAX_COMPOUND_COLLISION_SHAPES`)."""

_SHAPES = {
    "box": pybullet.GEOM_BOX,
    "cylinder": pybullet.GEOM_CYLINDER,
    "sphere": pybullet.GEOM_SPHERE,
}


class _Shape(NamedTuple):
    """Shape from which PyBullet makes a body: all its parts, those that cameras see, and its
    group.
    """

    parts: Sequence[Part]
    seen: Sequence[Part]
    group: int


class BulletBodies:
    """Bodies by id, which count from 0 in the order in which they are added, the ground first.
    PyBullet gets a body and its pose only when they are first needed. Most bodies of a street are
    never needed, and making one takes up to 2 ms.
    """

    def __init__(self, client: LentClient, ground: bool) -> None:
        self._client = client
        self._ground = ground
        self._shapes: dict[int, _Shape] = {}
        self._moved: set[int] = set()
        # PyBullet's numbers by id. PyBullet counts in the order in which it gets bodies.
        self._numbers: dict[int, int] = {}
        self._count = int(ground)

    def __getstate__(self) -> dict[str, Any]:
        # A copy has its own client, which is still empty.
        return vars(self) | {"_numbers": {}, "_moved": set(self._shapes)}

    def add(self, parts: Sequence[Part], seen: Sequence[Part], group: int) -> int:
        """Add a body of `parts`, of which cameras see `seen`, and return its id."""
        body = self._count
        self._count += 1
        self._shapes[body] = _Shape(parts, seen, group)
        self._moved.add(body)
        return body

    def moved(self, bodies: Iterable[int]) -> None:
        """Mark bodies as moved."""
        self._moved.update(bodies)

    def sync_all(self, poses: Floats) -> None:
        """Pass every body to PyBullet, at its `poses` (m, 7) by id."""
        self._sync(self._moved, poses)

    def sync(self, bodies: Sequence[int], poses: Floats) -> list[int]:
        """Pass some bodies to PyBullet, and return its numbers of them."""
        self._sync(self._moved.intersection(bodies), poses)
        return [self._numbers[body] for body in bodies]

    def ids_of(self, numbers: Integers) -> Integers:
        """Return the ids of bodies given by PyBullet's numbers; NO_BODY stays."""
        # NO_BODY, which is -1, picks the last entry.
        ids = np.full(len(self._numbers) + 1, NO_BODY)
        ids[list(self._numbers.values())] = list(self._numbers)
        return np.asarray(ids[numbers])

    def clearance(self, number: int, other: int, within: float) -> float:
        """Return the smallest distance between two hulls, given by PyBullet's numbers. See
        `care_sim.world.bullet.BulletWorld.clearance`.
        """
        points = pybullet.getClosestPoints(
            number, other, within, physicsClientId=self._client.number
        )
        return float(min((point[8] for point in points), default=np.inf))

    def _sync(self, moved: Iterable[int], poses: Floats) -> None:
        if self._ground and 0 not in self._numbers:
            self._numbers[0] = self._make_ground()
        # A copy: `moved` may be the very set that shrinks here. In the order of ids, so that what
        # PyBullet holds depends on no order of a set.
        for body in sorted(moved):
            if body not in self._numbers:
                self._numbers[body] = self._make(self._shapes[body])
            pose = poses[body].tolist()
            pybullet.resetBasePositionAndOrientation(
                self._numbers[body], pose[:3], pose[3:], physicsClientId=self._client.number
            )
            self._moved.discard(body)

    def _make(self, body: _Shape) -> int:
        # Mass 0: bodies stand where they are put, and nothing ever falls or is pushed.
        number = pybullet.createMultiBody(
            0,
            make_collision_shape(body.parts, self._client.number),
            self._visual_shape(body.seen) if body.seen else self._no_visual_shape(),
            physicsClientId=self._client.number,
        )
        self._set_group(number, body.group)
        return int(number)

    def _make_ground(self) -> int:
        plane = pybullet.createCollisionShape(
            pybullet.GEOM_PLANE, physicsClientId=self._client.number
        )
        unseen = self._no_visual_shape()
        ground = pybullet.createMultiBody(0, plane, unseen, physicsClientId=self._client.number)
        self._set_group(ground, OPAQUE)
        return int(ground)

    def _set_group(self, number: int, group: int) -> None:
        pybullet.setCollisionFilterGroupMask(
            number, -1, group, group, physicsClientId=self._client.number
        )

    def _visual_shape(self, parts: Sequence[Part]) -> int:
        return int(
            pybullet.createVisualShapeArray(physicsClientId=self._client.number, **_visual(parts))
        )

    def _no_visual_shape(self) -> int:
        """A speck deep below: without a visual shape PyBullet would draw the collision shape."""
        return self._visual_shape(
            [Part("box", (1e-4, 1e-4, 1e-4), (0.0, 0.0, -1e4), (0.0, 0.0, 0.0))]
        )


def make_collision_shape(parts: Sequence[Part], client: int) -> int:
    """Make a shape of `parts` in a client, and return PyBullet's number of the shape."""
    shapes = _collision(parts)
    return int(pybullet.createCollisionShapeArray(physicsClientId=client, **shapes))


def _collision(parts: Sequence[Part]) -> dict[str, Any]:
    return {
        "shapeTypes": [_SHAPES[part.shape] for part in parts],
        "halfExtents": [[extent / 2 for extent in part.size] for part in parts],
        "radii": [part.size[0] / 2 for part in parts],
        "lengths": [part.size[2] for part in parts],
        "collisionFramePositions": [part.centre for part in parts],
    }


def _visual(parts: Sequence[Part]) -> dict[str, Any]:
    shapes = _collision(parts)
    shapes["visualFramePositions"] = shapes.pop("collisionFramePositions")
    shapes["rgbaColors"] = [(*part.colour, 1.0) for part in parts]
    return shapes
