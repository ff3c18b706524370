"""Where the parts of bodies stand around a sensor, and the cells that each can cover, compiled."""

import math

import numpy as np

from care_sim.base.compiled import compiled

MARGIN = 1
"""Cells around a window, against rounding."""


@compiled()
def seen_from(sensor, parts, poses, lattice):  # type: ignore[no-untyped-def]
    """Parts in the frame of a sensor at `sensor`: x, y, z, yaw, roll, pitch of a
    `care_sim.core.frames.Frame`.

    `parts` are their half extents, offsets and body ids, `lattice` the grid's columns, rows, top
    and row height. Returns the world's up (3,), their centres (k, 3), their own axes (k, 3, 3), row
    i axis i, and their windows (k, 4): first and last column and row of the angular rectangle of
    the box that holds each. The first column lies on the grid, the last up to a turn beyond it; the
    first row lies below the last where a part covers none.
    """
    halves, offsets, owners = parts
    centres, turns, up = _placed(sensor, offsets, owners, poses)
    return up, centres, turns, _windows(centres, turns, halves, lattice)


@compiled()
def _placed(sensor, offsets, owners, poses):  # type: ignore[no-untyped-def]
    """Centres, axes and up."""
    centres, turns = np.empty((len(owners), 3)), np.empty((len(owners), 3, 3))
    axes = _sensor_axes(sensor[3], sensor[4], sensor[5])
    for part, owner in enumerate(owners):
        pose = poses[owner]
        body = _body_axes(pose[3], pose[4], pose[5], pose[6])
        away = (pose[0] - sensor[0], pose[1] - sensor[1], pose[2] - sensor[2])
        for j, axis in enumerate(axes):
            centres[part, j] = _dot(axis, away)
            for i in range(3):
                turns[part, i, j] = _dot(axis, body[i])
                centres[part, j] += offsets[part, i] * turns[part, i, j]
    return centres, turns, np.array((axes[0][2], axes[1][2], axes[2][2]))


@compiled()
def _windows(centres, turns, halves, lattice):  # type: ignore[no-untyped-def]
    bounds, corners = np.empty((len(centres), 4), np.int64), np.empty((8, 3))
    for part, centre in enumerate(centres):
        _lay_corners(centre, turns[part], halves[part], corners)
        heading, right, left = _spread(centre, corners)
        surrounds = left - right >= math.pi or (centre[0] == 0.0 and centre[1] == 0.0)
        if surrounds:
            heading, right, left = 0.0, -math.pi, math.pi
        bounds[part, 0], bounds[part, 1] = _columns(heading + right, heading + left, lattice[0])
        bounds[part, 2], bounds[part, 3] = _rows(corners, surrounds, lattice)
    return bounds


@compiled()
def _sensor_axes(yaw, roll, pitch):  # type: ignore[no-untyped-def]
    """Forward, left and up of a frame with these angles, in the world."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    return (
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )


@compiled()
def _body_axes(x, y, z, w):  # type: ignore[no-untyped-def]
    """The axes that the unit quaternion (x, y, z, w) gives a body, in the world."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled()
def _lay_corners(centre, axes, half, corners):  # type: ignore[no-untyped-def]
    """Fill `corners` (8, 3): bit i of a corner's number says on which side of axis i it lies."""
    for n in range(8):
        for j in range(3):
            corners[n, j] = centre[j]
            for i in range(3):
                corners[n, j] += (half[i] if n >> i & 1 else -half[i]) * axes[i, j]


@compiled()
def _spread(centre, corners):  # type: ignore[no-untyped-def]
    """Azimuth of a centre, and how far its corners reach to the right (negative) and left of it,
    radians.
    """
    rightmost, leftmost, least, most = (1.0, 0.0), (1.0, 0.0), 0.0, 0.0
    for x, y, _ in corners:
        along, across = centre[0] * x + centre[1] * y, centre[0] * y - centre[1] * x
        order = _order(along, across)
        if order < least:
            rightmost, least = (along, across), order
        if order > most:
            leftmost, most = (along, across), order
    right, left = math.atan2(rightmost[1], rightmost[0]), math.atan2(leftmost[1], leftmost[0])
    return math.atan2(centre[1], centre[0]), right, left


@compiled()
def _order(along, across):  # type: ignore[no-untyped-def]
    """Grows from -2 to 2 as the direction of (along, across) turns from -pi to pi, at less cost
    than the angle.
    """
    size = abs(along) + abs(across)
    share = across / size if size > 0.0 else 0.0
    return share if along >= 0.0 else math.copysign(2.0, across) - share


@compiled()
def _columns(right, left, columns):  # type: ignore[no-untyped-def]
    width = 2.0 * math.pi / columns
    first = math.floor((right + math.pi) / width) - MARGIN
    last = math.floor((left + math.pi) / width) + MARGIN
    return first % columns, first % columns + min(last - first, columns - 1)


@compiled()
def _rows(corners, surrounds, lattice):  # type: ignore[no-untyped-def]
    _, rows, top, row_height = lattice
    near, far = (0.0 if surrounds else _nearest(corners)), 0.0
    lowest, highest = math.inf, -math.inf
    for x, y, z in corners:
        far, lowest, highest = max(far, x * x + y * y), min(lowest, z), max(highest, z)
    far = math.sqrt(far)
    upper = (top - math.atan2(highest, near if highest > 0.0 else far)) / row_height
    lower = (top - math.atan2(lowest, near if lowest < 0.0 else far)) / row_height
    return max(0, math.ceil(upper) - MARGIN), min(rows - 1, math.floor(lower) + MARGIN)


@compiled()
def _nearest(corners):  # type: ignore[no-untyped-def]
    """Distance in the x, y plane from the origin to a box that does not surround it: to the nearest
    of its edges.
    """
    least = math.inf
    for n in range(8):
        for i in range(3):
            if not n >> i & 1:
                least = min(least, _to_edge(corners[n], corners[n | 1 << i]))
    return math.sqrt(least)


@compiled()
def _to_edge(one, other):  # type: ignore[no-untyped-def]
    """Squared distance in the x, y plane from the origin to the stretch between two corners."""
    x, y = one[0], one[1]
    along, across = other[0] - x, other[1] - y
    length = along * along + across * across
    share = min(1.0, max(0.0, -(x * along + y * across) / length)) if length > 0.0 else 0.0
    return (x + share * along) ** 2 + (y + share * across) ** 2


@compiled()
def _dot(one, other):  # type: ignore[no-untyped-def]
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
