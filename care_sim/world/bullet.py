"""The one owner of a PyBullet client: bodies, poses, rays, pictures of ids and colours, clearance.

World frame: x along the road, y left, z up; metres and radians.
"""

from collections.abc import Iterable, Sequence
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, Pose
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.body_tables import Primitives
from care_sim.world.bullet_clients import borrow, give_back, leave, pybullet
from care_sim.world.polyhedra import Polyhedra

PixelWindow = tuple[int, int, int, int]
"""Left, top, right, bottom in whole pixels."""

NO_BODY = -1
"""The id where there is no body."""
RAYS_PER_CALL = 8192
"""`rayTestBatch` returns nothing, silently, for a batch of 16,384 rays or more."""

_SHAPES = {
    "box": pybullet.GEOM_BOX,
    "cylinder": pybullet.GEOM_CYLINDER,
    "sphere": pybullet.GEOM_SPHERE,
}
_OPAQUE, _TRANSPARENT = 1, 2
FAR_M = 120.0
"""Nothing further from the image plane is seen."""


class BulletWorld:
    """Bodies in one DIRECT client, over a ground plane at z = 0 unless `ground` is False.

    It is not to be shared between processes. Where it is not closed, the client is given back with
    the last reference.

    The ground, transparent bodies and backdrops are not drawn: no camera needs their ids, and
    rendering them costs more than everything else in the picture.

    `primitives` know every pose at once. PyBullet learns of a pose when it is asked about the body.
    """

    def __init__(self, ground: bool = True) -> None:
        # A world that nobody closes leaves its client to others when it is collected. At the end of
        # the process there are none.
        self._client = borrow()
        self._abandoned = finalize(self, leave, self._client)
        self._abandoned.atexit = False
        self.primitives = Primitives()
        self.polyhedra = Polyhedra()
        self._moved: set[int] = set()
        self.ground = self._lay_ground() if ground else NO_BODY

    def _lay_ground(self) -> int:
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        unseen = self._no_visual_shape()
        ground = pybullet.createMultiBody(0, plane, unseen, physicsClientId=self._client)
        self._set_group(ground, _OPAQUE)
        return int(ground)

    def close(self) -> None:
        """Give the client back; calling it again does nothing."""
        if self._abandoned.detach():
            give_back(self._client)
            self._client = -1

    def add(
        self,
        kind: BodyKind,
        pose: Pose | Frame,
        *,
        transparent: bool = False,
        backdrop: bool = False,
    ) -> int:
        """Place a body and return its id. A `transparent` one is neither hit by rays nor seen.

        A `backdrop` stands behind all that perception reports: rays hit it, cameras need not render
        it.
        """
        seen = () if transparent or backdrop else kind.parts
        # Mass 0: bodies stand where they are put, and nothing ever falls or is pushed.
        body = pybullet.createMultiBody(
            0,
            self._collision_shape(kind.parts),
            self._visual_shape(seen) if seen else self._no_visual_shape(),
            physicsClientId=self._client,
        )
        self._set_group(body, _TRANSPARENT if transparent else _OPAQUE)
        self.primitives.add(body, () if transparent else kind.parts)
        self.polyhedra.add(body, seen)
        self.move(body, pose)
        self._tell([body])
        return int(body)

    def move(self, body: int, pose: Pose | Frame) -> None:
        """Put a body at a pose on the ground plane, or at a frame: anywhere, turned in any way."""
        self.primitives.poses[body] = _standing(pose)
        self._moved.add(body)

    def move_all(self, bodies: Integers, poses: Floats) -> None:
        """Put bodies (n,) at poses (n, 3) on the ground plane: x, y, heading."""
        # A turn by the angle yaw about z is the quaternion (0, 0, sin(yaw / 2), cos(yaw / 2)).
        half = poses[:, 2] / 2
        rows = np.zeros((len(poses), 7))
        rows[:, :2] = poses[:, :2]
        rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
        self.primitives.poses[bodies] = rows
        self._moved.update(bodies.tolist())

    def cast(self, origin: Floats, directions: Floats, reach: float) -> tuple[Floats, Integers]:
        """Cast rays (n, 3 unit vectors, world frame) from `origin`.

        Returns ranges (n,), inf where nothing was hit within `reach`, and body ids (n,), NO_BODY
        there.
        """
        # Bullet tests stretches, from a source to a target, and answers with the share of the way.
        self._tell(self._moved)
        targets = origin + directions * reach
        hits: list[tuple[Any, ...]] = []
        for start in range(0, len(targets), RAYS_PER_CALL):
            batch = targets[start : start + RAYS_PER_CALL]
            sources = np.broadcast_to(origin, batch.shape)
            hits += pybullet.rayTestBatch(
                sources, batch, collisionFilterMask=_OPAQUE, physicsClientId=self._client
            )
        # It fails by answering too little, not by an error.
        if len(hits) != len(targets):
            raise RuntimeError(f"PyBullet answered {len(hits)} of {len(targets)} rays")
        ids = np.fromiter((hit[0] for hit in hits), np.int64, len(hits))
        shares = np.fromiter((hit[2] for hit in hits), np.float64, len(hits))
        return np.where(ids == NO_BODY, np.inf, shares * reach), ids

    def body_ids(
        self, camera: PinholeCamera, sensor: Frame, window: PixelWindow | None = None
    ) -> Integers:
        """(height, width) id of the body each pixel of `camera` shows, NO_BODY where there is none.

        The camera is mounted in the frame `sensor`. With a `window`, only its own rows and columns
        are rendered and returned.
        """
        whole = 0, 0, camera.width, camera.height
        left, top, right, bottom = whole if window is None else window
        if left >= right or top >= bottom:
            return np.empty((0, 0), np.int64)
        rendered = self._render(camera, sensor, (left, top, right, bottom))[4]
        return np.asarray(rendered, np.int64).reshape(bottom - top, right - left)

    def colours(self, camera: PinholeCamera, sensor: Frame) -> NDArray[np.uint8]:
        """(height, width, 3) rendered picture of the same view as `body_ids`."""
        picture = self._render(camera, sensor, (0, 0, camera.width, camera.height))
        return np.asarray(picture[2], np.uint8).reshape(camera.height, camera.width, 4)[..., :3]

    def clearance(self, body: int, other: int, within: float = 100.0) -> float:
        """Smallest distance between two hulls, metres; negative when they overlap, inf beyond
        `within`.
        """
        self._tell({body, other} & self._moved)
        points = pybullet.getClosestPoints(body, other, within, physicsClientId=self._client)
        return float(min((point[8] for point in points), default=np.inf))

    def _tell(self, moved: Iterable[int]) -> None:
        """Let PyBullet know where bodies are by now."""
        # A copy: `moved` may be the very set that shrinks here.
        for body in tuple(moved):
            pose = self.primitives.poses[body].tolist()
            pybullet.resetBasePositionAndOrientation(
                body, pose[:3], pose[3:], physicsClientId=self._client
            )
            self._moved.discard(body)

    def _render(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> tuple[Any, ...]:
        self._tell(self._moved)
        eye, (forward, _, up) = camera.stance(sensor)
        left, top, right, bottom = window
        # The sides of the frustum of the window alone, where it cuts the near plane.
        scale = NEAR_M / camera.focal
        across = [(u - camera.width / 2) * scale for u in (left, right)]
        upward = [(camera.height / 2 - v) * scale for v in (bottom, top)]
        picture: tuple[Any, ...] = pybullet.getCameraImage(
            right - left,
            bottom - top,
            pybullet.computeViewMatrix(eye, eye + forward, up),
            pybullet.computeProjectionMatrix(*across, *upward, NEAR_M, FAR_M),
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return picture

    def _set_group(self, body: int, group: int) -> None:
        pybullet.setCollisionFilterGroupMask(body, -1, group, group, physicsClientId=self._client)

    def _collision_shape(self, parts: Sequence[Part]) -> int:
        shapes = _collision(parts)
        return int(pybullet.createCollisionShapeArray(physicsClientId=self._client, **shapes))

    def _visual_shape(self, parts: Sequence[Part]) -> int:
        return int(pybullet.createVisualShapeArray(physicsClientId=self._client, **_visual(parts)))

    def _no_visual_shape(self) -> int:
        """A speck deep below: without a visual shape PyBullet would draw the collision shape."""
        return self._visual_shape(
            [Part("box", (1e-4, 1e-4, 1e-4), (0.0, 0.0, -1e4), (0.0, 0.0, 0.0))]
        )


def _standing(pose: Pose | Frame) -> Sequence[float]:
    """Position x, y, z and quaternion x, y, z, w."""
    if isinstance(pose, Frame):
        return (*pose.origin.tolist(), *pose.rotation.as_quat().tolist())
    x, y, yaw = pose
    return x, y, 0.0, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)


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
