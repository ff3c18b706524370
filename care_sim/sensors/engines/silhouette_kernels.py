"""Silhouettes of convex polyhedra in a picture, row by row, compiled.

Take a ray through pixel (u, v), one metre long along the optical axis. It meets the plane n . x = h
of the camera's frame at the inverse depth (n . ray) / h, which is linear in u and v. The visible
surface of a polyhedron has the least inverse depth of its faces towards the camera. Its outline is
where a face towards the camera meets one that is turned away.

PyBullet's renderer samples column i at u = i and row j at v = j + 1, outlines included, and so does
this.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.geometry_kernels import dot
from care_sim.sensors.engines.view_kernels import (
    BodyInCamera,
    Lens,
    Meshes,
    PlacedCamera,
    body_in_camera,
    is_outside,
    rectangle_of,
    row_of,
)
from care_sim.world.bullet import PixelWindow

LOT = 8
"""Columns that are worked on together, as many as compiled code takes at once or a multiple."""
Outline = tuple[Floats, Floats, Floats]
"""Rows of an outline: the place of each in the picture, and its first and last column inside, not
rounded.
"""


class Silhouettes(NamedTuple):
    """Buffers for the polyhedra that a window of a picture shows.

    Visible polyhedra have places, in the order of the meshes. `owners` (k,) are their bodies.
    `facing` (f, 3) are the inverse depths of their faces towards the camera: per column, per row,
    and at pixel (0, 0). The faces of a place begin at `starts` (k + 1,), in threes, the last one
    repeated.

    Row r of the window crosses `counts[r]` polyhedra. `crossed` (height, k) are their places.
    `stretches` (height, k, 2) are the first column of each and the one after its last.

    Work on one polyhedron uses `planes` (f, 4) as in `_lay_planes`, `lines` (e, 3) as in
    `_lay_lines`, and an `outline`. `numbers` are 0.0, 1.0, 2.0, for every column and a lot more of
    them.
    """

    owners: Integers
    facing: Floats
    starts: Integers
    counts: Integers
    crossed: Integers
    stretches: Integers
    planes: Floats
    lines: Floats
    outline: Outline
    numbers: Floats


@compiled()
def room_for(counts: tuple[int, int, int], width: int, height: int) -> Silhouettes:
    """Room for polyhedra in windows of this height that end before a column `width`; `counts` are
    those of polyhedra, and of all their faces and edges.
    """
    parts, faces, edges = counts
    return Silhouettes(
        np.empty(parts, np.int64),
        np.empty((faces + 2 * parts, 3)),
        np.zeros(parts + 1, np.int64),
        np.empty(height, np.int64),
        np.empty((height, parts), np.int64),
        np.empty((height, parts, 2), np.int64),
        np.empty((faces, 4)),
        np.empty((edges, 3)),
        (np.empty(height), np.empty(height), np.empty(height)),
        np.arange(width + LOT).astype(np.float64),
    )


@compiled(error_model="numpy")
def lay_silhouettes(
    eye: PlacedCamera,
    optics: Lens,
    window: PixelWindow,
    depths: tuple[float, float],
    table: Meshes,
    poses: Floats,
    seen: Silhouettes,
) -> None:
    """Fill `seen` with what a window of the picture shows of the meshes. `depths` are the least and
    the greatest depth in metres, `poses` (m, 7) those of bodies by id.
    """
    # Whether the ball that holds a part meets the view comes first, then its rectangle in the
    # picture: a part beside the window costs no more than its corners.
    left, top, right, bottom = window
    nearest, farthest = depths
    view = nearest, farthest, left, right
    starts = table.starts
    seen.counts[: bottom - top] = 0
    place = 0
    for part in range(len(table.owners)):
        owner = table.owners[part]
        if is_outside(eye, poses, owner, table.reaches[part], optics, view):
            continue
        body = body_in_camera(eye, poses, owner)
        corners = starts[part, 0], starts[part + 1, 0]
        held = rectangle_of(table.corners, *corners, body, optics, nearest)
        upper, lower = max(held[1], top), min(held[3], bottom)
        if upper >= lower or max(held[0], left) >= min(held[2], right):
            continue

        faces = starts[part + 1, 1] - starts[part, 1]
        _lay_planes(table.faces, starts[part, 1], faces, body, optics, seen.planes)
        begin = seen.starts[place]
        end = _take_facing(seen.planes, faces, begin, seen.facing)
        # A camera inside of a body looks through it.
        if begin == end:
            continue
        seen.owners[place], seen.starts[place + 1] = owner, end
        _begin_outline(upper, lower - upper, left, right, seen.outline)
        edges = starts[part, 2], starts[part + 1, 2]
        lines = _lay_lines(table.edges, *edges, seen.planes, seen.lines)
        _cut_outline(seen.lines, lines, lower - upper, seen.outline)
        _add_stretches(place, upper - top, lower - upper, seen)
        place += 1


@compiled(error_model="numpy")
def _lay_planes(
    faces: Floats, begin: int, count: int, body: BodyInCamera, lens: Lens, planes: Floats
) -> None:
    """Fill `planes` (count, 4) with the inverse depths over the picture of the faces from `begin`
    on, and where each face is.

    Column 0 is by how much the inverse depth grows per column of the picture, column 1 per row,
    column 2 what it is at pixel (0, 0). Column 3 is the distance of the plane from the camera along
    its outward normal: negative for a face that is turned towards the camera.
    """
    turn = body.turn
    shift = body.shift
    for n in range(count):
        # A point p of the body is q = turn . p + shift in the camera's frame. The plane n . p = d
        # of the body becomes n' . q = h there, with the normal n' = turn . n, here its parts
        # (ahead, left, up), and h = d + n' . shift, here `offset`.
        normal = row_of(faces, begin + n)
        ahead, left, up = dot(turn[0], normal), dot(turn[1], normal), dot(turn[2], normal)
        offset = faces[begin + n, 3] + ahead * shift[0] + left * shift[1] + up * shift[2]

        # The ray of pixel (u, v) at the depth z is q = z * (1, (across - u) / focal,
        # (down - v) / focal). Put into n' . q = h and solved for 1 / z:
        #     1 / z = (ahead + left * (across - u) / focal + up * (down - v) / focal) / h.
        # The factor of u, the factor of v, and the rest:
        planes[n, 0] = -left / lens.focal / offset
        planes[n, 1] = -up / lens.focal / offset
        planes[n, 2] = (ahead + (left * lens.across + up * lens.down) / lens.focal) / offset
        planes[n, 3] = offset


@compiled()
def _take_facing(planes: Floats, count: int, begin: int, facing: Floats) -> int:
    """Fill `facing` from `begin` on with those of `count` faces that are turned towards the camera,
    in threes, the last one repeated. Returns the number after the last.
    """
    end = begin
    for n in range(count):
        if planes[n, 3] < 0.0:
            for k in range(3):
                facing[end, k] = planes[n, k]
            end += 1
    while (end - begin) % 3:
        for k in range(3):
            facing[end, k] = facing[end - 1, k]
        end += 1
    return end


@compiled()
def _begin_outline(upper: int, rows: int, left: int, right: int, outline: Outline) -> None:
    """Fill an outline with the whole of some rows of a window, from the row `upper` on."""
    height, first, last = outline
    for n in range(rows):
        height[n], first[n], last[n] = upper + n + 1.0, left, right - 1.0


@compiled()
def _lay_lines(edges: Integers, begin: int, end: int, planes: Floats, lines: Floats) -> int:
    """Fill `lines` (m, 3) with the outline of a polyhedron and return their number. `planes` (f, 4)
    are its faces; its edges are those from `begin` to the one before `end`. A line holds numbers
    per column, per row, and at pixel (0, 0). Their sum at a pixel is positive inside, 0 on the line
    and negative outside.
    """
    # An edge is on the outline where one of its two faces is turned towards the camera (distance
    # below 0) and the other is not. Along the edge both have one inverse depth, so that their
    # difference is 0 there; inside, the face towards the camera has the smaller one.
    count = 0
    for edge in range(begin, end):
        one, other = edges[edge, 0], edges[edge, 1]
        if (planes[one, 3] < 0.0) != (planes[other, 3] < 0.0):
            near, away = (one, other) if planes[one, 3] < 0.0 else (other, one)
            for k in range(3):
                lines[count, k] = planes[near, k] - planes[away, k]
            count += 1
    return count


@compiled(error_model="numpy")
def _cut_outline(lines: Floats, count: int, rows: int, outline: Outline) -> None:
    """Leave of so many rows of an outline what is inside of `count` lines."""
    # In one row a line leaves a half of the columns, from -here / slope on or up to there, or all,
    # or none. All rows in one loop: so the processor takes several at a time.
    height, first, last = outline
    for line in range(count):
        slope, rise, start = row_of(lines, line)
        if slope > 0.0:
            for n in range(rows):
                first[n] = max(first[n], -(start + rise * height[n]) / slope)
        elif slope < 0.0:
            for n in range(rows):
                last[n] = min(last[n], -(start + rise * height[n]) / slope)
        else:
            for n in range(rows):
                if start + rise * height[n] < 0.0:
                    last[n] = -math.inf


@compiled()
def _add_stretches(place: int, upper: int, rows: int, seen: Silhouettes) -> None:
    """Add what is inside `seen.outline` to so many rows of the window, from the row `upper` on."""
    _, first, last = seen.outline
    counts = seen.counts
    for n in range(rows):
        if first[n] <= last[n]:
            row = upper + n
            count = counts[row]
            seen.crossed[row, count] = place
            seen.stretches[row, count, 0] = math.ceil(first[n])
            seen.stretches[row, count, 1] = math.floor(last[n]) + 1
            counts[row] = count + 1
