"""Rays of a scan against the road and the parts of bodies, boxes, cylinders and spheres, compiled.

A box is cut out by three slabs (Kay and Kajiya 1986), a cylinder by a tube and a slab. A ray that
starts inside a solid does not enter it: Bullet's rays answer the same.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.world.bullet import NO_BODY

BOX, CYLINDER, SPHERE = range(3)
"""Places in `care_sim.world.body_tables.SHAPES`."""


@compiled(error_model="numpy")
def scan(cells, fan, reach, road, parts, stances, windows):  # type: ignore[no-untyped-def]
    """Ranges (n,) of ascending `cells`, inf beyond `reach`, and body ids (n,), NO_BODY there.

    `fan` is the grid's (smaller than its directions, and so nearer at hand); `road` is the world's
    up (3,) in the frame of the sensor, its height and the body id of the plane z = 0 (NO_BODY
    without). `parts` are their shapes, half extents and body ids, `stances` their centres and axes,
    `windows` their windows, both of `care_sim.sensors.engines.windows`.
    """
    shapes, halves, owners = parts
    centres, turns = stances
    columns = len(fan[0])
    starts = _row_starts(cells, len(fan[1]), columns)
    ranges, ids = _road(cells, starts, fan, reach, road)
    for part, (first, last, upper, lower) in enumerate(windows):
        turn = _triple(turns[part, 0]), _triple(turns[part, 1]), _triple(turns[part, 2])
        solid = shapes[part], turn, _triple(halves[part]), _start(turn, _triple(centres[part]))
        for row in range(upper, lower + 1):
            begin, low, high = row * columns, starts[row], starts[row + 1]
            ahead = _first_from(cells, begin + first, low, high)
            for place, end in ((low, begin + last - columns), (ahead, begin + last)):
                while place < high and cells[place] <= end:
                    distance = _entry(solid, _ray(fan, row, cells[place] - begin))
                    if distance < ranges[place] and distance <= reach:
                        ranges[place], ids[place] = distance, owners[part]
                    place += 1
    return ranges, ids


@compiled(error_model="numpy")
def _road(cells, starts, fan, reach, road):  # type: ignore[no-untyped-def]
    """What the rays meet in a world of road alone."""
    up, height, ground = road
    ranges, ids = np.full(len(cells), math.inf), np.full(len(cells), NO_BODY)
    if ground != NO_BODY:
        for row in range(len(starts) - 1):
            for n in range(starts[row], starts[row + 1]):
                distance = -height / _dot(up, _ray(fan, row, cells[n] - row * len(fan[0])))
                if 0.0 <= distance <= reach:
                    ranges[n], ids[n] = distance, ground
    return ranges, ids


@compiled()
def _row_starts(cells, rows, columns):  # type: ignore[no-untyped-def]
    """(rows + 1,) where each row begins among ascending `cells`."""
    starts = np.zeros(rows + 1, np.int64)
    for row in range(1, rows + 1):
        starts[row] = _first_from(cells, row * columns, starts[row - 1], len(cells))
    return starts


@compiled()
def _first_from(cells, cell, low, high):  # type: ignore[no-untyped-def]
    """The first place in low..high of ascending `cells` that holds `cell` or a later one, else
    `high`.
    """
    while low < high:
        middle = (low + high) // 2
        if cells[middle] < cell:
            low = middle + 1
        else:
            high = middle
    return low


@compiled()
def _ray(fan, row, column):  # type: ignore[no-untyped-def]
    """The direction of a cell."""
    across, down = fan
    return down[row, 0] * across[column, 0], down[row, 0] * across[column, 1], down[row, 1]


@compiled()
def _triple(row):  # type: ignore[no-untyped-def]
    """The numbers of an array (3,): passing views on would count references, ray by ray."""
    return row[0], row[1], row[2]


@compiled()
def _start(turn, centre):  # type: ignore[no-untyped-def]
    """The sensor in the frame of a part."""
    return -_dot(turn[0], centre), -_dot(turn[1], centre), -_dot(turn[2], centre)


@compiled(error_model="numpy")
def _entry(solid, ray):  # type: ignore[no-untyped-def]
    """Distance along a unit ray of the sensor's frame to a solid, inf without an entry."""
    shape, turn, half, (u, v, w) = solid
    x, y, z = _dot(turn[0], ray), _dot(turn[1], ray), _dot(turn[2], ray)
    if shape == BOX:
        near, far = _common(
            _common(_slab(u, x, half[0]), _slab(v, y, half[1])), _slab(w, z, half[2])
        )
    elif shape == CYLINDER:
        near, far = _common(_tube(u, v, x, y, half[0]), _slab(w, z, half[2]))
    else:
        near, far = _ball(u, v, w, x, y, z, half[0])
    return near if 0.0 <= near <= far else math.inf


@compiled()
def _common(one, other):  # type: ignore[no-untyped-def]
    return max(one[0], other[0]), min(one[1], other[1])


@compiled(error_model="numpy")
def _slab(start, along, half):  # type: ignore[no-untyped-def]
    """The stretch of a ray between the planes at -half and half."""
    if along == 0.0:
        return _all_or_nothing(abs(start) <= half)
    one, other = (-half - start) / along, (half - start) / along
    return min(one, other), max(one, other)


@compiled(error_model="numpy")
def _tube(u, v, x, y, radius):  # type: ignore[no-untyped-def]
    """The stretch of a ray within `radius` of the z axis, from (u, v) along (x, y) in the plane
    across it.
    """
    speed, cross = x * x + y * y, u * y - v * x
    inside = radius * radius * speed - cross * cross
    if speed == 0.0 or inside < 0.0:
        return _all_or_nothing(speed == 0.0 and u * u + v * v <= radius * radius)
    middle, half = -(u * x + v * y) / speed, math.sqrt(inside) / speed
    return middle - half, middle + half


@compiled(error_model="numpy")
def _ball(u, v, w, x, y, z, radius):  # type: ignore[no-untyped-def]
    """The stretch of a ray from (u, v, w) along (x, y, z) within `radius` of the origin."""
    middle = -(u * x + v * y + w * z)
    a, b, c = u + middle * x, v + middle * y, w + middle * z
    inside = radius * radius - (a * a + b * b + c * c)
    if inside < 0.0:
        return _all_or_nothing(False)
    return middle - math.sqrt(inside), middle + math.sqrt(inside)


@compiled()
def _all_or_nothing(everything):  # type: ignore[no-untyped-def]
    return (-math.inf, math.inf) if everything else (math.inf, -math.inf)


@compiled()
def _dot(one, other):  # type: ignore[no-untyped-def]
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
