"""Parts of bodies around a sensor, and the cells that each can cover, compiled.

Rays are tested only against parts whose window holds their cell. A window may hold too many cells,
but never too few: extra cells cost time and change nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import GridSpacing, row_at
from care_sim.sensors.engines.geometry_kernels import Axes, Vector, body_axes, dot

WINDOW_MARGIN = 0.001
"""Cells around a window, against rounding."""
NEAREST_MARGIN_M = 0.001
"""Margin of the nearest point of a part against rounding, metres."""
NO_CELLS = (0, 0, 0, -1)
"""The window of a part that covers none."""


class SensorPose(NamedTuple):
    """Where a sensor is in the world, as a `care_sim.core.frames.Frame`: metres and radians."""

    x: float
    y: float
    z: float
    yaw: float
    roll: float
    pitch: float


class Parts(NamedTuple):
    """The parts of bodies that rays can hit (`care_sim.world.body_tables`). `shapes` (k,) index
    SHAPES. Half extents `halves` (k, 3) and centres `offsets` (k, 3) are metres in the frame of the
    body. `owners` (k,) are body ids.
    """

    shapes: Integers
    halves: Floats
    offsets: Floats
    owners: Integers


class PlacedParts(NamedTuple):
    """Parts in the frame of a sensor. `centres` (k, 3) are metres; row i of `axes` (k, 3, 3) is the
    part's axis i. `windows` (k, 4) bound the box of each part: first and last column, first and
    last row. The first column lies within a turn, the last up to a turn beyond it. A part that
    covers no cell has its first row below the last; its other numbers are undefined. `nearest` (k,)
    is at most the distance of the part's nearest point. `up` (3,) is the world's up.
    """

    centres: Floats
    axes: Floats
    windows: Integers
    nearest: Floats
    up: Floats


@compiled()
def place_parts(
    sensor: SensorPose, parts: Parts, poses: Floats, grid: GridSpacing, reach: float
) -> PlacedParts:
    """The parts of bodies at `poses` (m, 7: x, y, z, quaternion x, y, z, w), by body id. A part
    wholly beyond the `reach` of a ray, metres, covers no cell.
    """
    # Told along the axes of the sensor, a vector is three scalar products with them.
    centres = np.empty((len(parts.owners), 3))
    axes = np.empty((len(parts.owners), 3, 3))
    windows = np.empty((len(parts.owners), 4), np.int64)
    nearest = np.zeros(len(parts.owners))
    corners = np.empty((8, 3))
    sensor_axes = _sensor_axes(sensor.yaw, sensor.roll, sensor.pitch)
    last = -1
    for part, owner in enumerate(parts.owners):
        # The parts of a body lie side by side.
        if owner != last or part == 0:
            pose = poses[owner]
            away = (pose[0] - sensor.x, pose[1] - sensor.y, pose[2] - sensor.z)
            body = body_axes(pose[3], pose[4], pose[5], pose[6])
            origin = _along(sensor_axes, away)
            turn = (
                _along(sensor_axes, body[0]),
                _along(sensor_axes, body[1]),
                _along(sensor_axes, body[2]),
            )
            last = owner
        if _is_beyond(away, parts.offsets[part], parts.halves[part], reach):
            for side in range(4):
                windows[part, side] = NO_CELLS[side]
            continue
        # Into the frame of the sensor: the origin of the body first, then the part's offset along
        # the axes of the body.
        for j in range(3):
            centres[part, j] = origin[j]
            for i in range(3):
                axes[part, i, j] = turn[i][j]
                centres[part, j] += parts.offsets[part, i] * turn[i][j]
        _lay_corners(centres[part], axes[part], parts.halves[part], corners)
        # The sides of an upright box are seen along its edges below: those above lie over them.
        is_upright = axes[part, 2, 0] == 0.0 and axes[part, 2, 1] == 0.0
        outline = corners[:4] if is_upright else corners
        window, nearest[part] = _window(centres[part], corners, outline, grid)
        for side in range(4):
            windows[part, side] = window[side]

    up = np.array((sensor_axes[0][2], sensor_axes[1][2], sensor_axes[2][2]))
    return PlacedParts(centres, axes, windows, nearest, up)


@compiled()
def _along(axes: Axes, vector: Vector) -> Vector:
    """A vector told along these axes."""
    return dot(axes[0], vector), dot(axes[1], vector), dot(axes[2], vector)


@compiled()
def _is_beyond(away: Vector, offset: Floats, half: Floats, reach: float) -> bool:
    """Whether a part lies wholly farther than `reach` from where its body is `away`, by the ball
    about the body that holds it.
    """
    # A millimetre is room for rounding.
    radius = math.sqrt(dot(offset, offset)) + math.sqrt(dot(half, half))
    return math.sqrt(dot(away, away)) > reach + radius + 0.001


@compiled()
def _window(
    centre: Floats, corners: Floats, outline: Floats, grid: GridSpacing
) -> tuple[tuple[int, int, int, int], float]:
    """See `PlacedParts.windows` and `PlacedParts.nearest`. `outline` are those of the `corners`
    that bound the box in the x, y plane.
    """
    heading, right, left = _spread(centre, outline)

    # Corners that spread over half a turn leave the sensor no side to look from: the part is
    # around, above or below it, and may cover every column.
    surrounds = left - right >= math.pi or (centre[0] == 0.0 and centre[1] == 0.0)
    if surrounds:
        heading = 0.0
        right, left = -math.pi, math.pi
    first, last = _columns(heading + right, heading + left, grid)
    near = 0.0 if surrounds else _nearest(outline)
    upper, lower = _rows(corners, near, grid)
    return (first, last, upper, lower), near - NEAREST_MARGIN_M


@compiled()
def _sensor_axes(yaw: float, roll: float, pitch: float) -> Axes:
    """Forward, left and up of a frame with these angles, in the world."""
    # The columns of Rz(yaw) Ry(pitch) Rx(roll), as in `care_sim.core.frames.Frame`.
    cy, sy = math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    return (
        (cy * cp, sy * cp, -sp),
        (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    )


@compiled()
def _lay_corners(centre: Floats, axes: Floats, half: Floats, corners: Floats) -> None:
    """Fill `corners` (8, 3). Bit i of a corner's number says on which side of axis i it lies."""
    for n in range(8):
        for j in range(3):
            corners[n, j] = centre[j]
            for i in range(3):
                corners[n, j] += (half[i] if n >> i & 1 else -half[i]) * axes[i, j]


@compiled()
def _spread(centre: Floats, corners: Floats) -> tuple[float, float, float]:
    """Azimuth of a centre, and how far its corners reach to the right (negative) and left of it,
    radians.
    """
    rightmost = (1.0, 0.0)
    leftmost = (1.0, 0.0)
    least, most = 0.0, 0.0
    for n in range(len(corners)):
        x, y = corners[n, 0], corners[n, 1]
        # The corner in the plane turned so that the centre lies straight ahead. Angles are compared
        # by a measure that is cheap, and only the two extreme ones are computed.
        along, across = centre[0] * x + centre[1] * y, centre[0] * y - centre[1] * x
        order = _angle_order(along, across)
        if order < least:
            rightmost = (along, across)
            least = order
        if order > most:
            leftmost = (along, across)
            most = order
    right, left = math.atan2(rightmost[1], rightmost[0]), math.atan2(leftmost[1], leftmost[0])
    return math.atan2(centre[1], centre[0]), right, left


@compiled()
def _angle_order(along: float, across: float) -> float:
    """Grows from -2 to 2 as the direction of (along, across) turns from -pi to pi, at less cost
    than the angle.
    """
    # The direction as a point of the square |along| + |across| = 1. Ahead, its part across grows
    # with the angle from -1 to 1. Behind, it falls, and is turned over to go on from 1 to 2 on the
    # left and from -1 to -2 on the right.
    size = abs(along) + abs(across)
    share = across / size if size > 0.0 else 0.0
    return share if along >= 0.0 else math.copysign(2.0, across) - share


@compiled()
def _columns(right: float, left: float, grid: GridSpacing) -> tuple[int, int]:
    """First column, within a turn, and last, up to a turn beyond it, between two azimuths."""
    # The ray of a column runs through its middle.
    first = math.ceil((right - grid.right) / grid.column_width - 0.5 - WINDOW_MARGIN)
    last = math.floor((left - grid.right) / grid.column_width - 0.5 + WINDOW_MARGIN)
    return first % grid.turn, first % grid.turn + min(last - first, grid.turn - 1)


@compiled()
def _rows(corners: Floats, near: float, grid: GridSpacing) -> tuple[int, int]:
    """First and last row of the box with these corners, which is as `near` in the x, y plane."""
    # How far in that plane, how low and how high the box is.
    far = 0.0
    lowest, highest = math.inf, -math.inf
    for n in range(len(corners)):
        x, y, z = corners[n, 0], corners[n, 1], corners[n, 2]
        far = max(far, x * x + y * y)
        lowest, highest = min(lowest, z), max(highest, z)
    far = math.sqrt(far)

    # A top above the sensor appears highest where it is nearest, one below it where it is farthest;
    # a bottom the other way round. Row i holds one elevation, that of its rays, so only the rows
    # between the two count.
    upper = row_at(math.atan2(highest, near if highest > 0.0 else far), grid)
    lower = row_at(math.atan2(lowest, near if lowest < 0.0 else far), grid)
    first = max(0, math.ceil(upper - WINDOW_MARGIN))
    return first, min(grid.rows - 1, math.floor(lower + WINDOW_MARGIN))


@compiled()
def _nearest(corners: Floats) -> float:
    """Distance in the x, y plane from the origin to a box that does not surround it: that to the
    nearest of its edges.
    """
    least = math.inf
    for n in range(len(corners)):
        for i in range(3):
            # An edge joins two corners that differ in one bit.
            if not n >> i & 1 and n | 1 << i < len(corners):
                other = n | 1 << i
                edge = corners[n, 0], corners[n, 1], corners[other, 0], corners[other, 1]
                least = min(least, _to_edge(edge))
    return math.sqrt(least)


@compiled()
def _to_edge(edge: tuple[float, float, float, float]) -> float:
    """Squared distance in the x, y plane from the origin to the stretch between two corners, x and
    y of each.
    """
    # The nearest point of the line, at the share of the way where the connection to the origin is
    # at a right angle, and held between the ends.
    x, y = edge[0], edge[1]
    along, across = edge[2] - x, edge[3] - y
    length = along * along + across * across
    share = min(1.0, max(0.0, -(x * along + y * across) / length)) if length > 0.0 else 0.0
    squared: float = (x + share * along) ** 2 + (y + share * across) ** 2
    return squared
