"""Rays of a scan against the road and the parts of bodies: boxes, cylinders and spheres, compiled.

A box is cut out by three slabs (Kay and Kajiya 1986), a cylinder by a tube and a slab. A ray that
starts inside a solid does not enter it: Bullet's rays answer the same.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import Cells
from care_sim.core.grid_kernels import GridSpacing
from care_sim.sensors.engines.geometry_kernels import Axes, Vector, dot
from care_sim.sensors.engines.window_kernels import Parts, SensorPose, place_parts
from care_sim.world.bullet import NO_BODY

BOX, CYLINDER, SPHERE = range(3)
"""Places in `care_sim.world.body_tables.SHAPES`."""

Stretch = tuple[float, float]
"""Where a ray enters and leaves, as distances along it; the first is the larger where it misses."""


class Fan(NamedTuple):
    """Cosine and sine of the azimuth of every column `across` (columns, 2), and of the elevation of
    every row `down` (rows, 2). They are fewer than the directions of all cells, and so nearer at
    hand in the processor's cache.
    """

    across: Floats
    down: Floats


class RoadPlane(NamedTuple):
    """The plane z = 0 of the world: the world's `up` (3,) in the frame of the sensor, the `height`
    of the sensor in metres, and the `body` id of the ground, NO_BODY without one.
    """

    up: Floats
    height: float
    body: int


class Solid(NamedTuple):
    """A part as rays meet it: its `axes` in the frame of the sensor, its half extents `half`, and
    the sensor in the frame of the part, `start`.
    """

    shape: int
    axes: Axes
    half: Vector
    start: Vector


@compiled(error_model="numpy")
def cast_rays(
    cells: Cells,
    reach: float,
    fan: tuple[Floats, Floats],
    spacing: tuple[int, int, float, float, float, float, int, Floats],
    sensor: Floats,
    parts: tuple[Integers, Floats, Floats, Integers],
    poses: Floats,
    ground: int,
) -> tuple[Floats, Integers]:
    """Ranges (n,) of ascending `cells` in metres, inf beyond `reach`, and body ids (n,), NO_BODY
    there.

    `fan` holds the fields of `Fan`, `spacing` those of `GridSpacing`, `sensor` (6,) those of
    `SensorPose`, `parts` those of `Parts`. `poses` (m, 7) are those of bodies by id, and `ground`
    is the body id of the road, NO_BODY without one.
    """
    # Fields get their names here: numba takes microseconds to type each named tuple of Python,
    # which is much of the time of a scan, and next to none for plain ones.
    ranges = np.empty(len(cells))
    ids = np.empty(len(cells), np.int64)
    returns = ranges, ids
    cast_into(
        returns,
        cells,
        reach,
        Fan(*fan),
        GridSpacing(*spacing),
        sensor,
        Parts(*parts),
        poses,
        ground,
    )
    return returns


@compiled(error_model="numpy")
def cast_into(
    returns: tuple[Floats, Integers],
    cells: Cells,
    reach: float,
    rays: Fan,
    grid: GridSpacing,
    sensor: Floats,
    solids: Parts,
    poses: Floats,
    ground: int,
) -> None:
    """Fill `returns` (n,), (n,) with what `cast_rays` gives."""
    ranges, ids = returns
    x, y, z, yaw, roll, pitch = sensor
    placed = place_parts(SensorPose(x, y, z, yaw, roll, pitch), solids, poses, grid, reach)

    # The road first, then part after part: what is nearer takes the ray. So no list of hits is
    # sorted, and the order of parts matters only where two are equally far.
    columns = len(rays.across)
    starts = _row_starts(cells, len(rays.down), columns)
    _hit_road(returns, cells, starts, rays, reach, RoadPlane(placed.up, z, ground))

    for part, (first, last, upper, lower) in enumerate(placed.windows):
        if upper > lower:
            continue
        solid = _solid(part, solids, placed.centres, placed.axes)
        for row in range(upper, lower + 1):
            # The fired cells of this row that lie in the window. A window that runs over a turn has
            # two stretches of columns: from the row's begin, and from its first column on.
            begin = row * columns
            low = starts[row]
            high = starts[row + 1]
            ahead = _first_from(cells, begin + first, low, high)
            for place, end in ((low, begin + last - grid.turn), (ahead, begin + last)):
                while place < high and cells[place] <= end:
                    distance = _entry(solid, _ray(rays, row, cells[place] - begin))
                    if distance < ranges[place] and distance <= reach:
                        ranges[place] = distance
                        ids[place] = solids.owners[part]
                    place += 1


@compiled(error_model="numpy")
def _hit_road(
    returns: tuple[Floats, Integers],
    cells: Cells,
    starts: Integers,
    fan: Fan,
    reach: float,
    road: RoadPlane,
) -> None:
    """Fill `returns` with those of a world of road alone."""
    ranges, ids = returns
    ranges[:] = math.inf
    ids[:] = NO_BODY
    if road.body != NO_BODY:
        for row in range(len(starts) - 1):
            for n in range(starts[row], starts[row + 1]):
                # A ray falls by -up . ray per metre. Above the horizon the distance is negative,
                # and along it infinite.
                ray = _ray(fan, row, cells[n] - row * len(fan.across))
                distance = -road.height / dot(road.up, ray)
                if 0.0 <= distance <= reach:
                    ranges[n] = distance
                    ids[n] = road.body


@compiled()
def _row_starts(cells: Cells, rows: int, columns: int) -> Integers:
    """(rows + 1,) where each row begins among ascending `cells`."""
    # Each search goes on from the row before, since cells ascend.
    starts = np.zeros(rows + 1, np.int64)
    for row in range(1, rows + 1):
        starts[row] = _first_from(cells, row * columns, starts[row - 1], len(cells))
    return starts


@compiled()
def _first_from(cells: Cells, cell: int, low: int, high: int) -> int:
    """The first place in low..high of ascending `cells` that holds `cell` or a later one, else
    `high`.
    """
    # Bisection: all before `low` are lower, all from `high` on are not.
    while low < high:
        middle = (low + high) // 2
        if cells[middle] < cell:
            low = middle + 1
        else:
            high = middle
    return low


@compiled()
def _ray(fan: Fan, row: int, column: int) -> Vector:
    """The direction of a cell, a unit vector in the frame of the sensor."""
    across, down = fan.across, fan.down
    return down[row, 0] * across[column, 0], down[row, 0] * across[column, 1], down[row, 1]


@compiled()
def _solid(part: int, parts: Parts, centres: Floats, axes: Floats) -> Solid:
    """A part with its numbers at hand: views on arrays would count references, ray by ray."""
    # The sensor is the origin of its own frame, so seen from the part it is at minus the centre.
    turn = _triple(axes[part, 0]), _triple(axes[part, 1]), _triple(axes[part, 2])
    centre = _triple(centres[part])
    start = -dot(turn[0], centre), -dot(turn[1], centre), -dot(turn[2], centre)
    return Solid(parts.shapes[part], turn, _triple(parts.halves[part]), start)


@compiled()
def _triple(row: Floats) -> Vector:
    """The numbers of an array (3,)."""
    return row[0], row[1], row[2]


@compiled(error_model="numpy")
def _entry(solid: Solid, ray: Vector) -> float:
    """Distance along a unit ray of the sensor's frame to a solid, inf without an entry."""
    # The ray in the frame of the part: from (u, v, w) along (x, y, z).
    u, v, w = solid.start
    x, y, z = dot(solid.axes[0], ray), dot(solid.axes[1], ray), dot(solid.axes[2], ray)
    half = solid.half
    if solid.shape == BOX:
        sides = _common(_slab(u, x, half[0]), _slab(v, y, half[1]))
        near, far = _common(sides, _slab(w, z, half[2]))
    elif solid.shape == CYLINDER:
        near, far = _common(_tube(u, v, x, y, half[0]), _slab(w, z, half[2]))
    else:
        near, far = _ball(u, v, w, x, y, z, half[0])

    # Negative where the ray starts inside or beyond: neither is an entry.
    return near if 0.0 <= near <= far else math.inf


@compiled()
def _common(one: Stretch, other: Stretch) -> Stretch:
    """The stretch that two have in common."""
    return max(one[0], other[0]), min(one[1], other[1])


@compiled(error_model="numpy")
def _slab(start: float, along: float, half: float) -> Stretch:
    """The stretch of a ray between the planes at -half and half."""
    # A ray along the planes is between them everywhere or nowhere; 0 / 0 must not decide it.
    if along == 0.0:
        return _all_or_nothing(abs(start) <= half)
    one, other = (-half - start) / along, (half - start) / along
    return min(one, other), max(one, other)


@compiled(error_model="numpy")
def _tube(u: float, v: float, x: float, y: float, radius: float) -> Stretch:
    """The stretch of a ray within `radius` of the z axis, from (u, v) along (x, y) in the plane
    across it.
    """
    # The distance t solves |(u, v) + t (x, y)|^2 = radius^2. Its discriminant is written with the
    # cross product, which keeps digits that u * u + v * v of a far start would lose.
    speed = x * x + y * y
    cross = u * y - v * x
    inside = radius * radius * speed - cross * cross
    if speed == 0.0 or inside < 0.0:
        return _all_or_nothing(speed == 0.0 and u * u + v * v <= radius * radius)

    # The middle is where the ray is nearest to the axis; it enters and leaves half a chord away.
    middle = -(u * x + v * y) / speed
    half = math.sqrt(inside) / speed
    return middle - half, middle + half


@compiled(error_model="numpy")
def _ball(u: float, v: float, w: float, x: float, y: float, z: float, radius: float) -> Stretch:
    """The stretch of a ray from (u, v, w) along (x, y, z) within `radius` of the origin."""
    # (a, b, c) is the point of the ray that is nearest to the origin.
    middle = -(u * x + v * y + w * z)
    a, b, c = u + middle * x, v + middle * y, w + middle * z
    inside = radius * radius - (a * a + b * b + c * c)
    if inside < 0.0:
        return _all_or_nothing(False)
    return middle - math.sqrt(inside), middle + math.sqrt(inside)


@compiled()
def _all_or_nothing(everything: bool) -> Stretch:
    """The whole ray, or a stretch that is empty."""
    return (-math.inf, math.inf) if everything else (math.inf, -math.inf)
