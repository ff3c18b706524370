"""The only owner of a PyBullet client: bodies, poses, rays, pictures of ids and colours, clearance.

World frame: x along the road, y left, z up; metres and radians.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, Pose
from care_sim.core.pinhole import NEAR_M, PinholeCamera
from care_sim.world.bodies import BodyKind
from care_sim.world.body_tables import Polyhedra, Primitives, stand_at
from care_sim.world.bullet_bodies import (
    NO_BODY,
    OPAQUE,
    TRANSPARENT,
    BulletBodies,
    LentClient,
    pybullet,
)

__all__ = ["FAR_M", "NO_BODY", "RAYS_PER_CALL", "BulletWorld", "PixelWindow"]

PixelWindow = tuple[int, int, int, int]
"""Left, top, right, bottom in whole pixels."""

RAYS_PER_CALL = 8192
"""`rayTestBatch` returns nothing, silently, for a batch of 16,384 rays or more."""
FAR_M = 120.0
"""Depth of view: cameras see nothing farther from the image plane."""


class BulletWorld:
    """Bodies in one DIRECT client, over a ground plane at z = 0 unless `ground` is False. Do not
    share it between processes. An unclosed world gives its client back with its last reference.

    The ground, transparent bodies and backdrops are not drawn. No camera needs their ids, and
    rendering them costs more than the rest of the picture.

    `primitives` and `polyhedra` hold every body and pose at once. PyBullet gets a body and its pose
    when they are first needed. A client is borrowed when PyBullet is first needed.
    """

    def __init__(self, ground: bool = True) -> None:
        self._client = LentClient()
        self.primitives = Primitives()
        self.polyhedra = Polyhedra()
        self._bodies = BulletBodies(self._client, ground)
        self.ground = 0 if ground else NO_BODY

    def close(self) -> None:
        """Give the client back; calling it again does nothing."""
        self._client.close()

    def add(
        self,
        kind: BodyKind,
        pose: Pose | Frame,
        *,
        transparent: bool = False,
        backdrop: bool = False,
    ) -> int:
        """Place a body and return its id. Rays and cameras ignore a `transparent` body. A
        `backdrop` stands behind everything that perception reports: rays hit it, cameras need not
        render it.
        """
        seen = () if transparent or backdrop else kind.parts
        body = self._bodies.add(kind.parts, seen, TRANSPARENT if transparent else OPAQUE)
        self.primitives.add(body, () if transparent else kind.parts)
        self.polyhedra.add(body, seen)
        self.move(body, pose)
        return body

    def move(self, body: int, pose: Pose | Frame) -> None:
        """Move a body to a pose on the ground plane, or to any frame."""
        self.primitives.poses[body] = _standing(pose)
        self._bodies.moved([body])

    def move_all(self, bodies: Integers, poses: Floats) -> None:
        """Put bodies (n,) at poses (n, 3) on the ground plane: x, y, heading."""
        # A turn by the angle yaw about z is the quaternion (0, 0, sin(yaw / 2), cos(yaw / 2)).
        half = poses[:, 2] / 2
        stand_at(self.primitives.poses, bodies, poses, np.sin(half), np.cos(half))
        self._bodies.moved(bodies.tolist())

    @contextmanager
    def placed(self, poses: Floats) -> Iterator[None]:
        """Place the bodies at `poses` (m, 7) within the block, instead of `primitives.poses`."""
        own = self.primitives.poses
        changed = np.flatnonzero((poses != own).any(axis=1)).tolist()
        self.primitives.poses = poses
        self._bodies.moved(changed)
        try:
            yield
        finally:
            self.primitives.poses = own
            self._bodies.moved(changed)

    def cast(self, origin: Floats, directions: Floats, reach: float) -> tuple[Floats, Integers]:
        """Cast rays (n, 3 unit vectors, world frame) from `origin`.

        Returns ranges (n,), inf where nothing was hit within `reach`, and body ids (n,), NO_BODY
        there.
        """
        # Bullet tests stretches, from a source to a target, and answers with the share of the way.
        self._bodies.sync_all(self.primitives.poses)
        targets = origin + directions * reach
        hits: list[tuple[Any, ...]] = []
        for start in range(0, len(targets), RAYS_PER_CALL):
            batch = targets[start : start + RAYS_PER_CALL]
            sources = np.broadcast_to(origin, batch.shape)
            hits += pybullet.rayTestBatch(
                sources, batch, collisionFilterMask=OPAQUE, physicsClientId=self._client.number
            )
        # A failed call returns too few answers and raises no error.
        if len(hits) != len(targets):
            raise RuntimeError(f"PyBullet answered {len(hits)} of {len(targets)} rays")
        ids = np.fromiter((hit[0] for hit in hits), np.int64, len(hits))
        shares = np.fromiter((hit[2] for hit in hits), np.float64, len(hits))
        return np.where(ids == NO_BODY, np.inf, shares * reach), self._bodies.ids_of(ids)

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
        numbers = np.asarray(rendered, np.int64).reshape(bottom - top, right - left)
        return self._bodies.ids_of(numbers)

    def colours(self, camera: PinholeCamera, sensor: Frame) -> NDArray[np.uint8]:
        """(height, width, 3) rendered picture of the same view as `body_ids`."""
        picture = self._render(camera, sensor, (0, 0, camera.width, camera.height))
        return np.asarray(picture[2], np.uint8).reshape(camera.height, camera.width, 4)[..., :3]

    def clearance(self, body: int, other: int, within: float = 100.0) -> float:
        """Smallest distance between two hulls, metres; negative when they overlap, inf beyond
        `within`.
        """
        own, others = self._bodies.sync([body, other], self.primitives.poses)
        return self._bodies.clearance(own, others, within)

    def _render(self, camera: PinholeCamera, sensor: Frame, window: PixelWindow) -> tuple[Any, ...]:
        self._bodies.sync_all(self.primitives.poses)
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
            physicsClientId=self._client.number,
        )
        return picture


def _standing(pose: Pose | Frame) -> Sequence[float]:
    """Position x, y, z and quaternion x, y, z, w."""
    if isinstance(pose, Frame):
        return (*pose.origin.tolist(), *pose.rotation.as_quat().tolist())
    x, y, yaw = pose
    return x, y, 0.0, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)
