"""Where bodies are in the view of a camera, compiled: whether they are in it at all, and which
rectangle of the picture they lie in.
"""

import math
from typing import NamedTuple

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.geometry_kernels import Axes, Vector, body_axes, dot
from care_sim.world.bullet import PixelWindow

ROUNDING_PX = 0.1
"""Room for rounding around the corners of a polyhedron in a picture: pixels."""


class PlacedCamera(NamedTuple):
    """A camera in the world: its `place` (3,) and its `axes` (3, 3), rows forward, left and up."""

    place: Floats
    axes: Floats


class Lens(NamedTuple):
    """Focal length and principal point, `across` from the left and `down` from the top, pixels."""

    focal: float
    across: float
    down: float


class Meshes(NamedTuple):
    """The polyhedra of parts, concatenated, in the frames of their bodies
    (`care_sim.world.body_tables.Polyhedra.tables`). `corners` (c, 3). `faces` (f, 4) are outward
    normals and distances from the body's origin. `edges` (e, 2) are the two faces that meet in each
    edge, counted within the part. `starts` (k + 1, 3) are the first rows of each part in these
    three tables. `owners` (k,) are body ids, with the parts of a body side by side. `reaches` (k,)
    are how far each part reaches from the body's origin.
    """

    corners: Floats
    faces: Floats
    edges: Integers
    starts: Integers
    owners: Integers
    reaches: Floats


class BodyInCamera(NamedTuple):
    """From the frame of a body to that of a camera: first `turn`, row by row, then `shift`."""

    turn: Axes
    shift: Vector


@compiled()
def is_outside(
    camera: PlacedCamera,
    poses: Floats,
    body: int,
    reach: float,
    lens: Lens,
    view: tuple[float, float, int, int],
) -> bool:
    """Return True if a ball of radius `reach` about a body lies wholly outside a view. The view's
    first two numbers are its least and greatest depth, the other two its columns.
    """
    nearest, farthest, first, last = view
    place = camera.place
    away = _away(poses, body, place)
    depth = dot(camera.axes[0], away)
    if depth + reach < nearest or depth - reach > farthest:
        return True
    # The plane of the eye and a column u is left * focal = (across - u) * depth. A column more on
    # either side is room for rounding.
    left = dot(camera.axes[1], away) * lens.focal
    before, beyond = lens.across - first + 1.0, lens.across - last - 1.0
    return left - before * depth > reach * math.hypot(
        lens.focal, before
    ) or beyond * depth - left > reach * math.hypot(lens.focal, beyond)


@compiled()
def body_in_camera(camera: PlacedCamera, poses: Floats, number: int) -> BodyInCamera:
    """Return a body's pose in the camera's frame."""
    body = body_axes(poses[number, 3], poses[number, 4], poses[number, 5], poses[number, 6])
    away = _away(poses, number, camera.place)
    # A point p of the body lies at position + body . p in the world. Told along the axes of the
    # camera, from its place, that is turn . p + shift.
    ahead, left, up = row_of(camera.axes, 0), row_of(camera.axes, 1), row_of(camera.axes, 2)
    turn = _along_each(ahead, body), _along_each(left, body), _along_each(up, body)
    return BodyInCamera(turn, _along_each(away, (ahead, left, up)))


@compiled()
def _away(poses: Floats, body: int, place: Floats) -> Vector:
    """From a place (3,) to the position of a body."""
    return poses[body, 0] - place[0], poses[body, 1] - place[1], poses[body, 2] - place[2]


@compiled()
def _along_each(vector: Vector, axes: Axes) -> Vector:
    """The parts of a vector along three axes."""
    return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector)


@compiled()
def row_of(table: Floats, n: int) -> Vector:
    """The first three numbers of a row. Numbers at hand: a view on an array counts references."""
    return table[n, 0], table[n, 1], table[n, 2]


@compiled()
def rectangle_of(
    corners: Floats, begin: int, end: int, body: BodyInCamera, lens: Lens, nearest: float
) -> PixelWindow:
    """Return the columns and rows of a polyhedron in the picture, as a window that excludes its
    right and bottom. Returns the whole picture if the polyhedron crosses the plane at the depth
    `nearest`.
    """
    # The picture of a convex body before the camera is bounded by those of its corners.
    turn = body.turn
    shift = body.shift
    least_u, most_u, least_v, most_v = math.inf, -math.inf, math.inf, -math.inf
    behind = 0
    for n in range(begin, end):
        corner = row_of(corners, n)
        depth = shift[0] + dot(turn[0], corner)
        if depth < nearest:
            behind += 1
        else:
            scale = lens.focal / depth
            u = lens.across - scale * (shift[1] + dot(turn[1], corner))
            v = lens.down - scale * (shift[2] + dot(turn[2], corner))
            least_u, most_u = min(least_u, u), max(most_u, u)
            least_v, most_v = min(least_v, v), max(most_v, v)

    # The picture is as wide and as high as twice the principal point lies across and down. Column i
    # is sampled at u = i and row j at v = j + 1: many a thin body far away lies between two of
    # them.
    width, height = 2 * lens.across, 2 * lens.down
    if behind == end - begin:
        return 0, 0, 0, 0
    if behind > 0:
        return 0, 0, math.ceil(width), math.ceil(height)
    first = math.ceil(min(max(least_u, 0.0), width) - ROUNDING_PX)
    upper = math.ceil(min(max(least_v, 0.0), height) - 1.0 - ROUNDING_PX)
    last = math.floor(max(min(most_u, width), 0.0) + ROUNDING_PX) + 1
    return first, upper, last, math.floor(max(min(most_v, height), 0.0) - 1.0 + ROUNDING_PX) + 1
