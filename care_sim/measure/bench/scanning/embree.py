"""Embree, through Open3D's RaycastingScene: triangles, built anew whenever a body moves."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.base.extras import import_open3d
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.grid import AngularGrid, Cells
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.bullet import NO_BODY

_SIDES = 8
"""Sides of a cylinder. More sides cost time, since Embree builds its tree anew for every scan, and
move a ray on the leg of a person by 6 mm at most.
"""
_GROUND_M = 200.0


class Embree:
    """Bodies as one mesh of triangles. Raises MissingExtra without Open3D."""

    def __init__(self, kinds: Sequence[BodyKind], grid: AngularGrid):
        self._grid = grid
        self._open3d = import_open3d()
        meshes = [_ground(), *(self._mesh(part) for kind in kinds for part in kind.parts)]
        owners = [0, *(body for body, kind in enumerate(kinds, 1) for _ in kind.parts)]

        # One mesh: the triangles of each part count its vertices from where the part starts.
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])[:-1]
        self._vertices = np.concatenate([vertices for vertices, _ in meshes])
        triangles = np.concatenate(
            [t + start for (_, t), start in zip(meshes, starts, strict=True)]
        )
        self._triangles = self._open3d.core.Tensor(triangles.astype(np.uint32))

        # Vertices move with their body; a hit triangle tells the body. The ground is body 0.
        self._vertex_owner = np.repeat(owners, [len(vertices) for vertices, _ in meshes])
        self._triangle_owner = np.repeat(owners, [len(triangles) for _, triangles in meshes])

    def place(self, poses: Floats) -> None:
        """Move all bodies: (n, 3) x, y, heading."""
        x, y, heading = np.vstack([np.zeros(3), poses])[self._vertex_owner].T
        placed = turned(self._vertices, heading)
        placed[:, 0] += x
        placed[:, 1] += y
        self._scene = self._open3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            self._open3d.core.Tensor(placed.astype(np.float32)), self._triangles
        )

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit, and body ids (n,), -1 there."""
        rays = np.empty((len(cells), 6), np.float32)
        rays[:, :3] = sensor.origin
        rays[:, 3:] = sensor.vectors_to_world(self._grid.directions[cells])
        hits = self._scene.cast_rays(self._open3d.core.Tensor(rays), nthreads=1)
        ranges = hits["t_hit"].numpy().astype(np.float64)
        # Embree knows no reach, and answers with inf where a ray meets nothing.
        met = ranges <= self._grid.range_m
        ids = np.full(len(rays), NO_BODY)
        ids[met] = self._triangle_owner[hits["primitive_ids"].numpy()[met]]
        return np.where(met, ranges, np.inf), ids

    def _mesh(self, part: Part) -> tuple[Floats, Integers]:
        """Vertices (v, 3) in the body's frame and triangles (t, 3) of a primitive."""
        shapes = self._open3d.geometry.TriangleMesh
        x, y, z = part.size
        mesh: Any
        if part.shape == "box":
            mesh = shapes.create_box(x, y, z)
        elif part.shape == "cylinder":
            mesh = shapes.create_cylinder(x / 2, z, _SIDES, 1)
        else:
            mesh = shapes.create_sphere(x / 2, _SIDES // 2)
        vertices = np.asarray(mesh.vertices)
        # Open3D puts the origin of a box at a corner, that of round bodies in the middle.
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        return vertices - middle + np.array(part.centre), np.asarray(mesh.triangles, np.int64)


def _ground() -> tuple[Floats, Integers]:
    corners = _GROUND_M * np.array(
        [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]
    )
    return corners, np.array([[0, 1, 2], [0, 2, 3]])
