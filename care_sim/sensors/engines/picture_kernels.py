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
from care_sim.sensors.engines.geometry_kernels import Axes, Vector, body_axes, dot
from care_sim.world.bullet import NO_BODY, PixelWindow

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
    """From the frame of a body to that of a camera: first `turn`, row by row, then `shift`."""

    turn: Axes
    shift: Vector


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
    surfaces = np.empty(right - left)

    # Part after part into one depth buffer. Whether the ball that holds it meets the view comes
    # first, then its rectangle in the picture: a part beside the window costs no more than its
    # corners.
    view = nearest, farthest, left, right
    greatest = 1.0 / nearest
    for part, owner in enumerate(table.owners):
        if _is_outside(eye, poses[owner], table.reaches[part], optics, view):
            continue
        begin, end = table.starts[part], table.starts[part + 1]
        body = _seen_from(eye, poses[owner])
        held = _rectangle(table.corners[begin[0] : end[0]], body, optics, nearest)
        upper, lower = max(held[1], top), min(held[3], bottom)
        if upper >= lower or max(held[0], left) >= min(held[2], right):
            continue

        # The depth test: what is nearer than all before it, at an inverse depth within the bounds,
        # takes the pixel. Of equal depths the later part does.
        planes = _planes(table.faces[begin[1] : end[1]], body, optics)
        towards, outline = _outline(planes, table.edges[begin[2] : end[2]])
        for row in range(upper, lower):
            first, last = _span(outline, row + 1.0, left, right)
            if first >= last:
                continue
            surface = surfaces[first - left : last - left]
            _lay_surface(towards, first, row + 1.0, surface)
            depth = inverse_depths[row - top, first - left : last - left]
            line = ids[row - top, first - left : last - left]
            for n in range(len(line)):
                is_seen = depth[n] <= surface[n] <= greatest
                depth[n] = surface[n] if is_seen else depth[n]
                line[n] = owner if is_seen else line[n]
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
    body = body_axes(pose[3], pose[4], pose[5], pose[6])
    away = pose[0] - place[0], pose[1] - place[1], pose[2] - place[2]
    # A point p of the body lies at position + body . p in the world. Told along the axes of the
    # camera, from its place, that is turn . p + shift.
    ahead, left, up = _row(camera.axes, 0), _row(camera.axes, 1), _row(camera.axes, 2)
    turn = _along_each(ahead, body), _along_each(left, body), _along_each(up, body)
    return BodyInCamera(turn, _along_each(away, (ahead, left, up)))


@compiled()
def _along_each(vector: Vector, axes: Axes) -> Vector:
    """The parts of a vector along three axes."""
    return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector)


@compiled()
def _row(table: Floats, n: int) -> Vector:
    """The first three numbers of a row. Numbers at hand: a view on an array counts references."""
    return table[n, 0], table[n, 1], table[n, 2]


@compiled()
def _rectangle(corners: Floats, body: BodyInCamera, lens: Lens, nearest: float) -> PixelWindow:
    """The columns and rows of a polyhedron in the picture, as a window that ends before its right
    and bottom; the whole picture when it reaches through the plane at the depth `nearest`.
    """
    # The picture of a convex body before the camera is bounded by those of its corners.
    turn = body.turn
    shift = body.shift
    least_u, most_u, least_v, most_v = math.inf, -math.inf, math.inf, -math.inf
    behind = 0
    for n in range(len(corners)):
        corner = _row(corners, n)
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
    if behind == len(corners):
        return 0, 0, 0, 0
    if behind > 0:
        return 0, 0, math.ceil(width), math.ceil(height)
    first = math.ceil(min(max(least_u, 0.0), width) - ROUNDING_PX)
    upper = math.ceil(min(max(least_v, 0.0), height) - 1.0 - ROUNDING_PX)
    last = math.floor(max(min(most_u, width), 0.0) + ROUNDING_PX) + 1
    return first, upper, last, math.floor(max(min(most_v, height), 0.0) - 1.0 + ROUNDING_PX) + 1


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
    for n in range(len(faces)):
        # A point p of the body is q = turn . p + shift in the camera's frame. The plane n . p = d
        # of the body becomes n' . q = h there, with the normal n' = turn . n, here its parts
        # (ahead, left, up), and h = d + n' . shift, here `offset`.
        normal = _row(faces, n)
        ahead, left, up = dot(turn[0], normal), dot(turn[1], normal), dot(turn[2], normal)
        offset = faces[n, 3] + ahead * shift[0] + left * shift[1] + up * shift[2]

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
    for n in range(len(outline)):
        slope, rise, start = _row(outline, n)
        here = start + rise * v
        if slope > 0.0:
            first = max(first, -here / slope)
        elif slope < 0.0:
            last = min(last, -here / slope)
        elif here < 0.0:
            last = -math.inf
    return (math.ceil(first), math.floor(last) + 1) if first <= last else (left, left)


@compiled()
def _lay_surface(towards: Floats, first: int, v: float, surface: Floats) -> None:
    """Fill `surface` (n,) with the inverse depths of a polyhedron in the row at `v`, from the
    column `first` on, at pixels inside its outline.
    """
    # A ray is inside a convex body once it has passed all planes that face the camera. The farthest
    # of them has the least inverse depth. Face by face: so the processor takes several pixels at a
    # time.
    surface[:] = math.inf
    for face in range(len(towards)):
        across, down, start = _row(towards, face)
        for n in range(len(surface)):
            surface[n] = min(surface[n], start + across * (first + n) + down * v)
