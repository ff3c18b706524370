"""Pictures of body ids, compiled: convex polyhedra drawn into a depth buffer.

A ray through pixel (u, v), one metre long along the optical axis, meets the plane n . x = h of the
camera's frame at the inverse depth (n . ray) / h, which is linear in u and v. What is seen of a
polyhedron lies at the least of these among its faces towards the camera; its outline is where a
face towards the camera meets one that is turned away. PyBullet's renderer samples column i at u = i
and row j at v = j + 1, outlines included, and so does this.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.world.bullet import NO_BODY


@compiled(error_model="numpy")
def paint(camera, lens, window, reach, meshes, poses):  # type: ignore[no-untyped-def]
    """(height, width) body ids of the pixels of `window` (left, top, right, bottom), NO_BODY where
    none is.

    `camera` is its place in the world (3,) and its axes forward, left and up (3, 3); `lens` its
    focal length and principal point in pixels; `reach` the least and the greatest depth drawn in
    metres; `meshes` the tables of `care_sim.world.polyhedra.Polyhedra`; `poses` (m, 7) of
    bodies by id.
    """
    left, top, right, bottom = window
    corners, faces, edges, starts, owners = meshes
    ids = np.full((bottom - top, right - left), NO_BODY)
    inverse_depths = np.full(ids.shape, 1.0 / reach[1])
    for part, owner in enumerate(owners):
        begin, end = starts[part], starts[part + 1]
        turn, shift = _seen_from(camera, poses[owner])
        upper, lower = _rows(corners[begin[0] : end[0]], turn, shift, lens, reach[0])
        upper, lower = max(upper, top), min(lower, bottom)
        if upper < lower:
            planes = _planes(faces[begin[1] : end[1]], turn, shift, lens)
            towards, outline = _outline(planes, edges[begin[2] : end[2]])
            for row in range(upper, lower):
                first, last = _span(outline, row + 1.0, left, right)
                for column in range(first, last):
                    inverse = _surface(towards, column, row + 1.0)
                    if inverse_depths[row - top, column - left] <= inverse <= 1.0 / reach[0]:
                        inverse_depths[row - top, column - left] = inverse
                        ids[row - top, column - left] = owner
    return ids


@compiled()
def tally(ids):  # type: ignore[no-untyped-def]
    """(n, 6) the bodies in a picture of ids in ascending order: id, left, top, right, bottom of the
    box that holds all its pixels, and their number.
    """
    highest = -1
    for body in ids.flat:
        highest = max(highest, body)
    found = np.zeros((highest + 1, 6), np.int64)
    for row, line in enumerate(ids):
        for column, body in enumerate(line):
            if body >= 0:
                one = found[body]
                if one[5] == 0:
                    one[:5] = body, column, row, column, row
                one[1], one[3], one[4] = min(one[1], column), max(one[3], column + 1), row + 1
                one[5] += 1
    return found[found[:, 5] > 0]


@compiled()
def _seen_from(camera, pose):  # type: ignore[no-untyped-def]
    """Turn (3, 3) and shift (3,) from the frame of a body at `pose` to that of the camera."""
    place, axes = camera
    body, turn, shift = _turn(pose[3], pose[4], pose[5], pose[6]), np.empty((3, 3)), np.empty(3)
    for i in range(3):
        shift[i] = _dot(axes[i], (pose[0] - place[0], pose[1] - place[1], pose[2] - place[2]))
        for j in range(3):
            turn[i, j] = _dot(axes[i], body[j])
    return turn, shift


@compiled()
def _turn(x, y, z, w):  # type: ignore[no-untyped-def]
    """The axes that the unit quaternion (x, y, z, w) gives a body, in the world."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled()
def _rows(corners, turn, shift, lens, nearest):  # type: ignore[no-untyped-def]
    """First row of a polyhedron and the one after its last; all rows when it reaches through the
    image plane.
    """
    focal, _, middle = lens
    high, low, behind = math.inf, -math.inf, 0
    for corner in corners:
        depth = shift[0] + _dot(turn[0], corner)
        if depth < nearest:
            behind += 1
        else:
            v = middle - focal * (shift[2] + _dot(turn[2], corner)) / depth
            high, low = min(high, v), max(low, v)
    if behind == len(corners):
        return 0, 0
    if behind > 0:
        return 0, math.ceil(2 * middle)
    return math.floor(min(max(high, 0.0), 2 * middle)) - 1, math.ceil(
        max(min(low, 2 * middle), 0.0)
    )


@compiled(error_model="numpy")
def _planes(faces, turn, shift, lens):  # type: ignore[no-untyped-def]
    """(f, 4) what is added a column and a row to the inverse depth of each face, what that is at
    pixel (0, 0), and the distance of the face before the camera, negative where it is turned
    towards it.
    """
    focal, across, down = lens
    planes = np.empty((len(faces), 4))
    for n, face in enumerate(faces):
        ahead, left, up = _dot(turn[0], face), _dot(turn[1], face), _dot(turn[2], face)
        offset = face[3] + ahead * shift[0] + left * shift[1] + up * shift[2]
        planes[n, 0], planes[n, 1] = -left / focal / offset, -up / focal / offset
        planes[n, 2] = (ahead + (left * across + up * down) / focal) / offset
        planes[n, 3] = offset
    return planes


@compiled()
def _outline(planes, edges):  # type: ignore[no-untyped-def]
    """The planes that are turned towards the camera, and the outline: lines (m, 3) that are
    positive inside.
    """
    lines, count = np.empty((len(edges), 3)), 0
    for one, other in edges:
        if planes[one, 3] < 0.0 <= planes[other, 3]:
            lines[count], count = planes[one, :3] - planes[other, :3], count + 1
        elif planes[other, 3] < 0.0 <= planes[one, 3]:
            lines[count], count = planes[other, :3] - planes[one, :3], count + 1
    return planes[planes[:, 3] < 0.0], lines[:count]


@compiled(error_model="numpy")
def _span(outline, v, left, right):  # type: ignore[no-untyped-def]
    """The first column inside an outline in the row at `v` and the one after the last."""
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
def _surface(towards, u, v):  # type: ignore[no-untyped-def]
    """The inverse depth of a polyhedron at a pixel inside its outline."""
    inverse = math.inf
    for n in range(len(towards)):
        inverse = min(inverse, towards[n, 2] + towards[n, 0] * u + towards[n, 1] * v)
    return inverse


@compiled()
def _dot(one, other):  # type: ignore[no-untyped-def]
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
