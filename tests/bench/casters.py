"""Casters of rays at the same moving bodies: our engines, and known ones beside them.

A caster has `place(poses)`, which moves all bodies, (n, 3) as x, y, heading, and
`cast(sensor, cells)`, which gives ranges (n,) in metres, inf without a hit, and body ids (n,), -1
there. The ground is body 0, the others count from 1.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d
from care_sim.core.frames import Frame, turned
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES
from care_sim.sensors.engines import ENGINES, make_engine
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import NO_BODY, BulletWorld

NEAREST_BODY_M = 8.0
"""No bus, which is 11 m long, reaches the sensor."""
FARTHEST_M = 48.0
"""Every body lies within the reach of 50 m."""
SWAY_M = 0.8
"""How far bodies move from scan to scan at most: 8 m/s over 0.1 s."""
SENSOR = Frame(0.0, 0.0, LIDAR_POSITION[2], 0.0)
SIDES = 8
"""Sides of a cylinder of Embree's. More sides cost time, since Embree builds its tree anew for
every scan, and move a ray on the leg of a person by 6 mm at most.
"""
GROUND_M = 200.0


@dataclass(frozen=True)
class MovingBodies:
    """`kinds` of the n bodies and where they stand on average: `poses` (n, 3) as x, y, heading."""

    kinds: tuple
    poses: np.ndarray

    def at(self, number):
        """(n, 3) poses at a scan: every body sways along its heading."""
        heading = self.poses[:, 2]
        moved = self.poses.copy()
        moved[:, 0] += SWAY_M * np.sin(number + 1) * np.cos(heading)
        moved[:, 1] += SWAY_M * np.sin(number + 1) * np.sin(heading)
        return moved


def moving_bodies(bodies, seed):
    """Bodies of the five classes in turn, evenly spread over the ring around the sensor."""
    rng = np.random.default_rng(seed)
    # Uniform in the square of the distance is uniform in area.
    distance = np.sqrt(rng.uniform(NEAREST_BODY_M**2, FARTHEST_M**2, bodies))
    bearing, heading = rng.uniform(-np.pi, np.pi, (2, bodies))
    kinds = tuple(CATALOGUE[CLASSES[number % len(CLASSES)]] for number in range(bodies))
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    return MovingBodies(kinds, np.column_stack([x, y, heading]))


def casters(kinds, grid, opened):
    """Every engine over bodies of these kinds, by name; and in one line each, what is left out.
    `opened` frees them.
    """
    made = {}
    for name in ENGINES:
        made[name] = OurEngine(name, kinds, grid)
        opened.callback(made[name].world.close)
    skipped = []
    for name, peer in PEERS.items():
        try:
            made[name] = peer(kinds, grid)
        except (ImportError, MissingExtra) as error:
            skipped.append(f"{name}: {error}")
    return made, skipped


class OurEngine:
    """An engine of the simulator over a PyBullet world with these bodies."""

    def __init__(self, engine, kinds, grid):
        self.world = BulletWorld()
        self.bodies = np.array([self.world.add(kind, (0.0, 0.0, 0.0)) for kind in kinds])
        self.cast = make_engine(engine, self.world, grid).cast

    def place(self, poses):
        self.world.move_all(self.bodies, poses)


class Embree:
    """Embree, through Open3D's RaycastingScene: one mesh of triangles, built anew whenever a body
    moves.
    """

    def __init__(self, kinds, grid):
        self.grid = grid
        self.open3d = import_open3d()
        corners = GROUND_M * np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
        ground = corners, np.array([[0, 1, 2], [0, 2, 3]])
        meshes = [ground, *(self._mesh(part) for kind in kinds for part in kind.parts)]
        owners = [0, *(body for body, kind in enumerate(kinds, 1) for _ in kind.parts)]

        # The triangles of each part count its vertices from where the part starts.
        counts = [len(vertices) for vertices, _ in meshes]
        starts = np.cumsum([0, *counts])[:-1]
        self.vertices = np.concatenate([vertices for vertices, _ in meshes])
        triangles = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
        self.triangles = self.open3d.core.Tensor(np.concatenate(triangles).astype(np.uint32))

        # Vertices move with their body; a hit triangle tells the body.
        self.vertex_owner = np.repeat(owners, counts)
        self.triangle_owner = np.repeat(owners, [len(faces) for _, faces in meshes])

    def place(self, poses):
        x, y, heading = np.vstack([np.zeros(3), poses])[self.vertex_owner].T
        placed = turned(self.vertices, heading)
        placed[:, 0] += x
        placed[:, 1] += y
        self.scene = self.open3d.t.geometry.RaycastingScene(nthreads=1)
        vertices = self.open3d.core.Tensor(placed.astype(np.float32))
        self.scene.add_triangles(vertices, self.triangles)

    def cast(self, sensor, cells):
        rays = np.empty((len(cells), 6), np.float32)
        rays[:, :3] = sensor.origin
        rays[:, 3:] = sensor.vectors_to_world(self.grid.directions[cells])
        hits = self.scene.cast_rays(self.open3d.core.Tensor(rays), nthreads=1)
        ranges = hits["t_hit"].numpy().astype(np.float64)
        # Embree knows no reach, and answers with inf where a ray meets nothing.
        met = ranges <= self.grid.range_m
        ids = np.full(len(rays), NO_BODY)
        ids[met] = self.triangle_owner[hits["primitive_ids"].numpy()[met]]
        return np.where(met, ranges, np.inf), ids

    def _mesh(self, part):
        """Vertices (v, 3) in the body's frame and triangles (t, 3) of a primitive."""
        shapes = self.open3d.geometry.TriangleMesh
        x, y, z = part.size
        if part.shape == "box":
            mesh = shapes.create_box(x, y, z)
        elif part.shape == "cylinder":
            mesh = shapes.create_cylinder(x / 2, z, SIDES, 1)
        else:
            mesh = shapes.create_sphere(x / 2, SIDES // 2)
        vertices = np.asarray(mesh.vertices)
        # Open3D puts the origin of a box at a corner, that of round bodies in the middle.
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        return vertices - middle + np.array(part.centre), np.asarray(mesh.triangles, np.int64)


class MuJoCo:
    """MuJoCo's mj_multiRay over the same primitives, moved as mocap bodies."""

    def __init__(self, kinds, grid):
        import mujoco

        # Bodies count from 1 in the order in which they are added, and body 0 is the world with its
        # plane: the ids of a caster. MuJoCo takes half extents; of a cylinder, radius and half
        # height.
        specification = mujoco.MjSpec()
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        specification.worldbody.add_geom(type=plane, size=(0, 0, 1))
        for kind in kinds:
            body = specification.worldbody.add_body(mocap=True)
            for part in kind.parts:
                x, y, z = (extent / 2 for extent in part.size)
                shape = getattr(mujoco.mjtGeom, f"mjGEOM_{part.shape.upper()}")
                size = (x, z, 0) if part.shape == "cylinder" else (x, y, z)
                body.add_geom(type=shape, size=size, pos=part.centre)
        self.grid, self.mujoco = grid, mujoco
        self.model = specification.compile()
        self.data = mujoco.MjData(self.model)

    def place(self, poses):
        self.data.mocap_pos[:, :2] = poses[:, :2]
        # The quaternion (w, 0, 0, z) of a turn about the vertical.
        self.data.mocap_quat[:, 0] = np.cos(poses[:, 2] / 2)
        self.data.mocap_quat[:, 3] = np.sin(poses[:, 2] / 2)
        self.mujoco.mj_kinematics(self.model, self.data)

    def cast(self, sensor, cells):
        directions = sensor.vectors_to_world(self.grid.directions[cells]).ravel()
        geoms, ranges = np.empty(len(cells), np.int32), np.empty(len(cells))
        # Geoms of every group, static ones too, no body left out; no normals are asked for.
        groups, static, left_out, normals = None, True, -1, None
        self.mujoco.mj_multiRay(
            self.model, self.data, sensor.origin, directions, groups, static, left_out, geoms,
            ranges, normals, len(cells), self.grid.range_m,
        )  # fmt: skip
        met = (geoms >= 0) & (ranges <= self.grid.range_m)
        return np.where(met, ranges, np.inf), np.where(met, self.model.geom_bodyid[geoms], NO_BODY)


PEERS = {"Embree (Open3D)": Embree, "MuJoCo": MuJoCo}
"""Known engines, by name."""
