"""Bodies as PyBullet's renderer draws them: convex polyhedra, which come close to round parts."""

import math
from functools import cache, lru_cache

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.world.bodies import Part
from care_sim.world.body_tables import OwnParts, owners_of

RING = 32
"""Points on each rim of a cylinder."""
RIM_M = 0.001
"""A cylinder is drawn larger by this."""
SAME_FACE = 9
"""Decimals to which two triangles of one face agree."""

Mesh = tuple[Floats, Floats, Integers]
Tables = tuple[Floats, Floats, Integers, Integers, Integers, Floats]

_NOTHING: Mesh = np.empty((0, 3)), np.empty((0, 4)), np.empty((0, 2), np.int64)


class Polyhedra:
    """Every part that cameras see, as a polyhedron in the frame of its body."""

    def __init__(self) -> None:
        self._bodies: list[OwnParts] = []
        self._tables: Tables | None = None

    def add(self, body: int, parts: tuple[Part, ...]) -> None:
        """Take in what is seen of a body, its parts in its own frame."""
        self._bodies.append((body, parts))
        self._tables = None

    @property
    def tables(self) -> Tables:
        """All k parts in one: corners (c, 3) in metres; faces (f, 4), outward unit normals and
        distances from the body's origin in metres; edges (e, 2), the two faces that meet in each,
        counted within the part. Then (k + 1, 3) where the rows of each part begin in these three,
        (k,) the body ids, and (k,) the distance of each part's farthest corner from the body's
        origin in metres.
        """
        if self._tables is None:
            self._tables = _joined(tuple(self._bodies))
        return self._tables


@lru_cache(maxsize=16)
def _joined(bodies: tuple[OwnParts, ...]) -> Tables:
    """See `Polyhedra.tables`. Many an episode has the bodies of the one before, elsewhere."""
    # A body without parts first: then there is always one to join.
    columns = zip(*map(_body, [(), *(parts for _, parts in bodies)]), strict=True)
    corners, faces, edges, sizes, reaches = map(np.concatenate, columns)
    starts = np.zeros((len(sizes) + 1, 3), np.int64)
    np.cumsum(sizes, axis=0, out=starts[1:])
    return corners, faces, edges, starts, owners_of(bodies), reaches


@lru_cache(maxsize=256)
def _body(parts: tuple[Part, ...]) -> tuple[Floats, Floats, Integers, Integers, Floats]:
    """Corners, faces and edges of a body's k parts, one after the other; (k, 3) how many there are
    of each in every part, and (k,) their reaches, as in `Polyhedra.tables`.
    """
    meshes = [_mesh(part) for part in parts]
    corners, faces, edges = map(np.concatenate, zip(_NOTHING, *meshes, strict=True))
    sizes = np.array([[len(column) for column in mesh] for mesh in meshes], np.int64)
    reaches = np.array([np.linalg.norm(mesh[0], axis=1).max() for mesh in meshes])
    return corners, faces, edges, sizes.reshape(-1, 3), reaches


def _mesh(part: Part) -> Mesh:
    """A part's polyhedron in the frame of its body."""
    # A plane n . p = d about the centre c is n . p = d + n . c about the body's origin.
    corners, faces, edges = polyhedron(part.shape, part.size)
    centre = np.array(part.centre)
    distances = faces[:, 3] + faces[:, :3] @ centre
    return corners + centre, np.column_stack([faces[:, :3], distances]), edges


@lru_cache(maxsize=256)
def polyhedron(shape: str, size: tuple[float, float, float]) -> Mesh:
    """Corners, faces and edges of a primitive about its centre; see `Polyhedra.tables`."""
    from scipy.spatial import ConvexHull

    corners = _corners(shape, np.array(size))
    hull = ConvexHull(corners)
    # Qhull gives triangles. Those of one face have one equation, up to the last bits, and two
    # triangles that meet on an edge of the polyhedron have different ones.
    equations, number = np.unique(np.round(hull.equations, SAME_FACE), axis=0, return_inverse=True)
    mine = np.repeat(number, hull.neighbors.shape[1])
    other = number[hull.neighbors].ravel()

    # Each edge is met from both sides: the one with the lower number first is kept. Triangles of
    # one face have one number, and no edge between them.
    meets = np.stack([mine, other], axis=1)
    edges = np.unique(meets[meets[:, 0] < meets[:, 1]], axis=0)
    return corners, equations * (1, 1, 1, -1), edges


def _corners(shape: str, size: Floats) -> Floats:
    if shape == "box":
        return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    if shape == "sphere":
        return np.multiply(directions(), size / 2)
    angles = 2 * np.pi * np.arange(RING) / RING
    sin, cos = np.sin(angles), np.cos(angles)
    rims = [np.column_stack([sin, cos, np.full(RING, side)]) for side in (1.0, -1.0)]
    points = np.concatenate(rims) * size / 2
    # Bullet draws the hull of the points that it finds furthest in some directions, each moved out
    # by its margin.
    furthest = np.argmax(np.round(directions() @ points.T, SAME_FACE), axis=1)
    drawn: Floats = points[furthest] + RIM_M * directions()
    return drawn


@cache
def directions() -> Floats:
    """(42, 3) the unit vectors in which Bullet's `btShapeHull` looks for the surface of a round
    shape: the corners of an icosahedron that stands on one of them, and the middles of its edges.
    """
    azimuths = np.deg2rad(np.arange(0, 360, 72))
    rings = [_ring(azimuths + np.deg2rad(36), -1.0), _ring(azimuths, 1.0)]
    corners = np.concatenate([[(0.0, 0.0, -1.0)], *rings, [(0.0, 0.0, 1.0)]])
    # Neighbours among the corners of an icosahedron are those whose cosine is 1 / sqrt(5).
    one, other = np.nonzero(np.triu(np.isclose(corners @ corners.T, 1 / np.sqrt(5))))
    middles = corners[one] + corners[other]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    spread: Floats = np.concatenate([corners, middles])
    return spread


def _ring(azimuths: Floats, side: float) -> Floats:
    """(n, 3) unit vectors of these azimuths; they rise (`side` 1) or fall (-1) by half their
    length in the plane.
    """
    heights = np.full(len(azimuths), side)
    points: Floats = np.column_stack([2 * np.cos(azimuths), 2 * np.sin(azimuths), heights])
    return points / math.sqrt(5)
