"""Pictures of body ids, compiled: convex polyhedra drawn into a depth buffer.

A ray through pixel (u, v), one metre long along the optical axis, meets the plane n . x = h of the
camera's frame at the inverse depth (n . ray) / h, which is linear in u and v. What is seen of a
polyhedron lies at the least of these among its faces towards the camera; its outline is where a
face towards the camera meets one that is turned away. PyBullet's renderer samples column i at u = i
and row j at v = j + 1, outlines included, and so does this.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.geometry_kernels import body_axes, dot
from care_sim.world.bullet import NO_BODY, PixelWindow


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
    """The polyhedra of parts one after the other, in the frames of their bodies, as in
    `care_sim.world.polyhedra.Polyhedra.tables`: `corners` (c, 3); `faces` (f, 4), outward normals
    and distances from the body's origin; `edges` (e, 2), the two faces that meet in each, counted
    within the part; `starts` (k + 1, 3), where the rows of a part begin in these three; `owners`
    (k,) body ids; `reaches` (k,) how far each part reaches from the body's origin.
    """

    corners: Floats
    faces: Floats
    edges: Integers
    starts: Integers
    owners: Integers
    reaches: Floats


class BodyInCamera(NamedTuple):
    """From the frame of a body to that of a camera: first `turn` (3, 3), then `shift` (3,)."""

    turn: Floats
    shift: Floats


@compiled(error_model="numpy")
def render_bodies(
    camera: tuple[Floats, Floats],
    lens: tuple[float, float, float],
    window: PixelWindow,
    depths: tuple[float, float],
    meshes: tuple[Floats, Floats, Integers, Integers, Integers, Floats],
    poses: Floats,
) -> Integers:
    """(height, width) body ids of the pixels of `window` (left, top, right, bottom), NO_BODY where
    none is.

    `camera` holds the fields of `PlacedCamera`, `lens` those of `Lens`, `meshes` those of `Meshes`;
    `depths` are the least and the greatest depth drawn in metres; `poses` (m, 7) are those of
    bodies by id.
    """
    # Fields get their names here: numba takes microseconds to type each named tuple of Python, and
    # next to none for plain ones.
    eye = PlacedCamera(*camera)
    optics = Lens(*lens)
    table = Meshes(*meshes)
    left, top, right, bottom = window
    nearest, farthest = depths
    ids = np.full((bottom - top, right - left), NO_BODY)
    inverse_depths = np.full(ids.shape, 1.0 / farthest)

    # Part after part into one depth buffer. Whether the ball that holds it meets the view comes
    # first, then its rows in the picture: a part above or below the window costs no more than its
    # corners.
    view = nearest, farthest, left, right
    greatest = 1.0 / nearest
    for part, owner in enumerate(table.owners):
        if _is_outside(eye, poses[owner], table.reaches[part], optics, view):
            continue
        begin, end = table.starts[part], table.starts[part + 1]
        body = _seen_from(eye, poses[owner])
        upper, lower = _rows(table.corners[begin[0] : end[0]], body, optics, nearest)
        upper, lower = max(upper, top), min(lower, bottom)
        if upper >= lower:
            continue

        # The depth test: what is nearer than all before it, at an inverse depth within the bounds,
        # takes the pixel. Of equal depths the later part does.
        planes = _planes(table.faces[begin[1] : end[1]], body, optics)
        towards, outline = _outline(planes, table.edges[begin[2] : end[2]])
        for row in range(upper, lower):
            first, last = _span(outline, row + 1.0, left, right)
            depth = inverse_depths[row - top, first - left : last - left]
            line = ids[row - top, first - left : last - left]
            for n in range(len(line)):
                inverse = _surface(towards, first + n, row + 1.0)
                if depth[n] <= inverse <= greatest:
                    depth[n] = inverse
                    line[n] = owner
    return ids


@compiled()
def _is_outside(
    camera: PlacedCamera,
    pose: Floats,
    reach: float,
    lens: Lens,
    view: tuple[float, float, int, int],
) -> bool:
    """Whether a ball of radius `reach` about the position of `pose` (7,) lies wholly outside of a
    view: nearer or farther than its first two numbers, or beside the columns of the other two.
    """
    nearest, farthest, first, last = view
    place = camera.place
    away = pose[0] - place[0], pose[1] - place[1], pose[2] - place[2]
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
def _seen_from(camera: PlacedCamera, pose: Floats) -> BodyInCamera:
    """A body at `pose` (7,) as the camera sees it."""
    place = camera.place
    axes = camera.axes
    body = body_axes(pose[3], pose[4], pose[5], pose[6])
    # A point p of the body lies at position + body . p in the world. Told along the axes of the
    # camera, from its place, that is turn . p + shift.
    turn = np.empty((3, 3))
    shift = np.empty(3)
    for i in range(3):
        shift[i] = dot(axes[i], (pose[0] - place[0], pose[1] - place[1], pose[2] - place[2]))
        for j in range(3):
            turn[i, j] = dot(axes[i], body[j])
    return BodyInCamera(turn, shift)


@compiled()
def _rows(corners: Floats, body: BodyInCamera, lens: Lens, nearest: float) -> tuple[int, int]:
    """First row of a polyhedron and the one after its last; all rows when it reaches through the
    plane at the depth `nearest`.
    """
    # The picture of a convex body before the camera is bounded by those of its corners.
    turn = body.turn
    shift = body.shift
    high, low = math.inf, -math.inf
    behind = 0
    for corner in corners:
        depth = shift[0] + dot(turn[0], corner)
        if depth < nearest:
            behind += 1
        else:
            v = lens.down - lens.focal * (shift[2] + dot(turn[2], corner)) / depth
            high, low = min(high, v), max(low, v)

    # The picture is as high as twice the principal point is down. Row j is sampled at v = j + 1, so
    # the rows wanted are those from high - 1 to low - 1. One too many at either end does no harm:
    # the outline leaves it empty.
    if behind == len(corners):
        return 0, 0
    if behind > 0:
        return 0, math.ceil(2 * lens.down)
    first = math.floor(min(max(high, 0.0), 2 * lens.down)) - 1
    return first, math.ceil(max(min(low, 2 * lens.down), 0.0))


@compiled(error_model="numpy")
def _planes(faces: Floats, body: BodyInCamera, lens: Lens) -> Floats:
    """(f, 4) the inverse depth of each face over the picture, and where the face is.

    Column 0 is by how much the inverse depth grows per column of the picture, column 1 per row,
    column 2 what it is at pixel (0, 0). Column 3 is the distance of the plane from the camera along
    its outward normal: negative for a face that is turned towards the camera.
    """
    turn = body.turn
    shift = body.shift
    planes = np.empty((len(faces), 4))
    for n, face in enumerate(faces):
        # A point p of the body is q = turn . p + shift in the camera's frame. The plane n . p = d
        # of the body becomes n' . q = h there, with the normal n' = turn . n, here its parts
        # (ahead, left, up), and h = d + n' . shift, here `offset`.
        ahead = dot(turn[0], face)
        left = dot(turn[1], face)
        up = dot(turn[2], face)
        offset = face[3] + ahead * shift[0] + left * shift[1] + up * shift[2]

        # The ray of pixel (u, v) at the depth z is q = z * (1, (across - u) / focal,
        # (down - v) / focal). Put into n' . q = h and solved for 1 / z:
        #     1 / z = (ahead + left * (across - u) / focal + up * (down - v) / focal) / h.
        # What stands with u, what stands with v, and the rest:
        planes[n, 0] = -left / lens.focal / offset
        planes[n, 1] = -up / lens.focal / offset
        planes[n, 2] = (ahead + (left * lens.across + up * lens.down) / lens.focal) / offset
        planes[n, 3] = offset
    return planes


@compiled()
def _outline(planes: Floats, edges: Integers) -> tuple[Floats, Floats]:
    """The inverse depths (t, 3) of the faces that are turned towards the camera, columns 0 to 2 of
    their rows in `planes`, and the outline of the body.

    The outline is lines (m, 3): per column, per row, and at pixel (0, 0), a number that is positive
    inside, 0 on the line and negative outside.
    """
    # Number by number: to pick or subtract rows would make an array each time.
    towards = np.empty((len(planes), 3))
    facing = 0
    for n in range(len(planes)):
        if planes[n, 3] < 0.0:
            for k in range(3):
                towards[facing, k] = planes[n, k]
            facing += 1

    # An edge is on the outline where one of its two faces is turned towards the camera (distance
    # below 0) and the other is not. Along the edge both have one inverse depth, so that their
    # difference is 0 there; inside, the face towards the camera has the smaller one.
    outline = np.empty((len(edges), 3))
    count = 0
    for n in range(len(edges)):
        one, other = edges[n, 0], edges[n, 1]
        if (planes[one, 3] < 0.0) != (planes[other, 3] < 0.0):
            near, away = (one, other) if planes[one, 3] < 0.0 else (other, one)
            for k in range(3):
                outline[count, k] = planes[near, k] - planes[away, k]
            count += 1
    return towards[:facing], outline[:count]


@compiled(error_model="numpy")
def _span(outline: Floats, v: float, left: int, right: int) -> tuple[int, int]:
    """The first column inside an outline in the row at `v` and the one after the last."""
    # In one row each line of the outline leaves a half of the columns, from -here / slope on or up
    # to there, or all, or none. What is inside of every one is a stretch.
    first, last = float(left), right - 1.0
    for slope, rise, start in outline:
        here = start + rise * v
        if slope > 0.0:
            first = max(first, -here / slope)
        elif slope < 0.0:
            last = min(last, -here / slope)
        elif here < 0.0:
            last = -math.inf
    return (math.ceil(first), math.floor(last) + 1) if first <= last else (left, left)


@compiled()
def _surface(towards: Floats, u: float, v: float) -> float:
    """The inverse depth of a polyhedron at a pixel inside its outline."""
    # A ray is inside a convex body once it has passed all planes that face the camera. The farthest
    # of them has the least inverse depth.
    inverse = math.inf
    for n in range(len(towards)):
        inverse = min(inverse, towards[n, 2] + towards[n, 0] * u + towards[n, 1] * v)
    return inverse
