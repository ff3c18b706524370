"""The bodies of a world as tables, a row per body: boxes, parts that rays can hit, polyhedra that
cameras see. Code that reads many bodies at once, such as a compiled engine, uses these instead of
PyBullet.
"""

import math
from collections.abc import Sequence
from functools import cache, lru_cache

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Pose
from care_sim.world.bodies import Part, Shape, Triple

OwnParts = tuple[int, tuple[Part, ...]]
"""A body and its parts."""
Solids = tuple[Integers, Floats, Floats, Integers]
"""Shapes, half extents, offsets and owners of parts; see `Primitives.tables`."""

SHAPES: tuple[Shape, ...] = ("box", "cylinder", "sphere")
"""Round parts stand along their own z; a shape's number is its place here."""


class Footprints:
    """`boxes` (m, 7) in the world frame, one row per body id: centre x, y, z, length, width, height
    and yaw; NaN where there is no such body.
    """

    def __init__(self) -> None:
        self.boxes = np.empty((0, 7))

    def add(self, body: int, size: Triple, pose: Pose) -> None:
        """Add a body of a size on the ground plane."""
        # Ids count upwards, the ground's among them: rows between stay NaN.
        self.boxes = _with_room(self.boxes, body, np.nan)
        x, y, heading = pose
        self.boxes[body] = x, y, size[2] / 2, *size, heading

    def move_all(self, bodies: Integers, poses: Floats) -> bool:
        """Put bodies (n,) at poses (n, 3): x, y, heading. Return whether all are finite."""
        return bool(_move(self.boxes, bodies, poses))

    def near(self, body: int, within: float) -> Integers:
        """Return the ids of other bodies that may be within `within` metres of a body. The list is
        complete. Some bodies may be farther away, since rectangles along x and y approximate the
        footprints.
        """
        return bodies_near(self.boxes, body, within)


@compiled()
def _move(boxes: Floats, bodies: Integers, poses: Floats) -> bool:
    """See `Footprints.move_all`."""
    total = 0.0
    for n in range(len(bodies)):
        box = boxes[bodies[n]]
        box[0], box[1], box[6] = poses[n, 0], poses[n, 1], poses[n, 2]
        total += poses[n, 0] + poses[n, 1] + poses[n, 2]
    return math.isfinite(total)


@compiled()
def stand_at(
    table: Floats, bodies: Integers, poses: Floats, sines: Floats, cosines: Floats
) -> None:
    """Put bodies (n,) into the `table` (m, 7) of `Primitives.poses` at `poses` (n, 3), x, y,
    heading, on the ground. Sines and cosines (n,) are those of half the headings.
    """
    for n in range(len(bodies)):
        row = table[bodies[n]]
        row[0], row[1], row[2] = poses[n, 0], poses[n, 1], 0.0
        row[3], row[4], row[5], row[6] = 0.0, 0.0, sines[n], cosines[n]


@compiled()
def bodies_near(boxes: Floats, body: int, within: float) -> Integers:
    """See `Footprints.near`."""
    found = np.empty(len(boxes), np.int64)
    count = 0
    own = boxes[body]
    for other in range(len(boxes)):
        box = boxes[other]
        # First by the circles that hold the footprints, which leave few for the rectangles. NaN,
        # where there is no body, is close to nothing.
        apart = math.hypot(box[0] - own[0], box[1] - own[1])
        reach = (math.hypot(box[3], box[4]) + math.hypot(own[3], own[4])) / 2
        if other != body and apart <= reach + within and _rectangles_near(own, box, within):
            found[count] = other
            count += 1
    return found[:count]


@compiled()
def _rectangles_near(one: Floats, other: Floats, within: float) -> bool:
    """Whether rectangles along x and y around two footprints are within `within` metres."""
    half_x, half_y = 0.0, 0.0
    for box in (one, other):
        # The sides of a turned rectangle, each projected on the axis.
        cos, sin = abs(math.cos(box[6])), abs(math.sin(box[6]))
        half_x += (box[3] * cos + box[4] * sin) / 2
        half_y += (box[3] * sin + box[4] * cos) / 2
    gap_x, gap_y = abs(one[0] - other[0]) - half_x, abs(one[1] - other[1]) - half_y
    return bool(gap_x <= within and gap_y <= within)


class Primitives:
    """Every part of the opaque bodies of one world, and where the bodies are.

    `poses` (m, 7), one row per body id: x, y, z in metres and the quaternion x, y, z, w, world
    frame.
    """

    def __init__(self) -> None:
        self.poses = np.empty((0, 7))
        self._bodies: list[OwnParts] = []
        self._tables: Solids | None = None

    def add(self, body: int, parts: tuple[Part, ...]) -> None:
        """Add a body by its parts in its own frame; a body that nothing can hit has none."""
        self.poses = _with_room(self.poses, body, 0.0)
        self._bodies.append((body, parts))
        self._tables = None

    @property
    def tables(self) -> Solids:
        """Return all k parts, body by body: (k,) places in SHAPES, (k, 3) half extents and (k, 3)
        centres in the body frame, metres, and (k,) body ids.
        """
        if self._tables is None:
            self._tables = _joined(tuple(self._bodies))
        return self._tables

    @property
    def materials(self) -> list[str]:
        """The names of all k parts' materials."""
        return [part.material for _, parts in self._bodies for part in parts]


@lru_cache(maxsize=16)
def _joined(bodies: tuple[OwnParts, ...]) -> Solids:
    """See `Primitives.tables`. Cached, since many episodes have the bodies of the previous one."""
    # Begin with a table without parts: then there is always one to join.
    columns = zip(*map(_columns, [(), *(parts for _, parts in bodies)]), strict=True)
    shapes, halves, offsets = map(np.concatenate, columns)
    return shapes, halves, offsets, owners_of(bodies)


def owners_of(bodies: Sequence[OwnParts]) -> Integers:
    """Return (k,) the body ids of all parts, body by body."""
    return np.repeat(
        np.array([body for body, _ in bodies], np.int64), [len(parts) for _, parts in bodies]
    )


@lru_cache(maxsize=1024)
def _columns(parts: tuple[Part, ...]) -> tuple[Integers, Floats, Floats]:
    """Shapes, half extents and offsets of a body's parts, as in `Primitives.tables`."""
    shapes = np.array([SHAPES.index(part.shape) for part in parts], np.int64)
    halves = np.array([part.size for part in parts], float).reshape(-1, 3) / 2
    return shapes, halves, np.array([part.centre for part in parts], float).reshape(-1, 3)


def _with_room(rows: Floats, body: int, empty: float) -> Floats:
    """Return a table (n, 7) with a row for a body: `rows`, or a longer copy whose new rows hold
    `empty`.
    """
    if body < len(rows):
        return rows
    longer = np.full((body + 1, 7), empty)
    longer[: len(rows)] = rows
    return longer


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
        """Add the visible parts of a body, in its own frame."""
        self._bodies.append((body, parts))
        self._tables = None

    @property
    def tables(self) -> Tables:
        """Return all k parts in one. Corners (c, 3) are in metres. Faces (f, 4) are outward unit
        normals and distances from the body's origin in metres. Edges (e, 2) are the two faces that
        meet in each edge, counted within the part.

        Then come (k + 1, 3) the first rows of each part in these three, and (k,) the body ids.
        Last, (k,) the distance of each part's farthest corner from the body's origin in metres.
        """
        if self._tables is None:
            self._tables = _joined_meshes(tuple(self._bodies))
        return self._tables


@lru_cache(maxsize=16)
def _joined_meshes(bodies: tuple[OwnParts, ...]) -> Tables:
    """See `Polyhedra.tables`. Cached, since many episodes have the bodies of the previous one."""
    # A body without parts first: then there is always one to join.
    columns = zip(*map(_body, [(), *(parts for _, parts in bodies)]), strict=True)
    corners, faces, edges, sizes, reaches = map(np.concatenate, columns)
    starts = np.zeros((len(sizes) + 1, 3), np.int64)
    np.cumsum(sizes, axis=0, out=starts[1:])
    return corners, faces, edges, starts, owners_of(bodies), reaches


@lru_cache(maxsize=1024)
def _body(parts: tuple[Part, ...]) -> tuple[Floats, Floats, Integers, Integers, Floats]:
    """Return corners, faces and edges of a body's k parts, concatenated. Also returns (k, 3) their
    numbers per part, and (k,) reaches as in `Polyhedra.tables`.
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
    # Qhull gives triangles. Triangles of one face have one equation, up to the last bits, and two
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
    """Return (42, 3) the unit vectors along which Bullet's `btShapeHull` samples a round shape.
    They are the corners of an icosahedron that stands on one of them, and the middles of its edges.
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
