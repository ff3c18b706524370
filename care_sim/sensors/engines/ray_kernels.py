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

_X, _Y, _Z = np.uintp(0), np.uintp(1), np.uintp(2)
_STRIDE_BITS = 5
"""Cells among which the first fired one is known; more are searched one by one."""
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
    firsts = _first_places(cells, grid.rows * grid.columns)

    # The road first, then part after part: what is nearer takes the ray. So no list of hits is
    # sorted, and the order of parts matters only where two are equally far.
    road = RoadPlane(placed.up, z, ground)
    _hit_road(ranges, ids, cells, firsts, rays.across, rays.down, reach, road)
    places = np.empty(len(cells), np.int64)
    picked = np.empty((3, len(cells)))
    distances = np.empty(len(cells))
    for part, (first, last, upper, lower) in enumerate(placed.windows):
        if upper > lower:
            continue
        window = first, last, upper, lower, grid.turn, placed.nearest[part]
        count = _pick(window, cells, firsts, rays.across, rays.down, ranges, places, picked)
        if count:
            solid = _solid(part, solids, placed.centres, placed.axes)
            _meet(solid, picked, distances, count)
            _take(ranges, ids, places, distances, count, solids.owners[part], reach)


# Arrays are handed over one by one from here on, and not as fields of tuples: to take one out of a
# tuple counts its references, which takes longer than to follow a ray.
@compiled(error_model="numpy")
def _hit_road(
    ranges: Floats,
    ids: Integers,
    cells: Cells,
    firsts: Integers,
    across: Floats,
    down: Floats,
    reach: float,
    road: RoadPlane,
) -> None:
    """Fill ranges and body ids with those of a world of road alone."""
    is_level = road.up[0] == 0.0 and road.up[1] == 0.0
    begin = 0
    for row in range(len(down)):
        # Over a level road all rays of a row are alike, but for the sign of zeros.
        end = _place_of(row * len(across) + len(across), cells, firsts)
        distance = _to_road(road, (0.0, 0.0, down[row, 1]))
        for n in range(begin, end):
            if not is_level:
                ray = _ray(across, down, row, cells[n] - row * len(across))
                distance = _to_road(road, ray)
            is_hit = 0.0 <= distance <= reach and road.body != NO_BODY
            ranges[n] = distance if is_hit else math.inf
            ids[n] = road.body if is_hit else NO_BODY
        begin = end


@compiled(error_model="numpy")
def _to_road(road: RoadPlane, ray: Vector) -> float:
    """How far a ray goes to the road: below 0 above the horizon, and infinite along it."""
    # A ray falls by -up . ray per metre.
    return -road.height / dot(road.up, ray)


@compiled()
def _first_places(cells: Cells, size: int) -> Integers:
    """(m,) where among ascending `cells` those from 0, 1, ... strides on begin; the grid has `size`
    cells.
    """
    # From the last one back, each cell is the first of its stride so far. A stride without cells
    # begins where the next one does.
    firsts = np.full((size >> _STRIDE_BITS) + 2, len(cells))
    for n in range(len(cells) - 1, -1, -1):
        firsts[cells[n] >> _STRIDE_BITS] = n
    first = len(cells)
    for k in range(len(firsts) - 1, -1, -1):
        first = min(first, firsts[k])
        firsts[k] = first
    return firsts


@compiled()
def _place_of(cell: int, cells: Cells, firsts: Integers) -> int:
    """Where a cell of the grid or the next later one is among those fired; behind the last one, if
    there is none.
    """
    place: int = firsts[cell >> _STRIDE_BITS]
    while place < len(cells) and cells[place] < cell:
        place += 1
    return place


@compiled()
def _pick(
    window: tuple[int, int, int, int, int, float],
    cells: Cells,
    firsts: Integers,
    across: Floats,
    down: Floats,
    ranges: Floats,
    places: Integers,
    picked: Floats,
) -> int:
    """Pick the rays of a window that have met nothing before `nearest`; how many they are. Their
    `places` (n,) among the cells and their directions `picked` (3, n) are filled in.
    """
    first, last, upper, lower, turn, nearest = window
    count = 0
    for row in range(upper, lower + 1):
        # A window that runs over a turn has two stretches of columns: up to its last one, and from
        # its first one on. It may run on into columns that the grid does not have.
        begin = row * len(across)
        level, height = down[row, 0], down[row, 1]
        for left, right in ((0, last - turn), (first, last)):
            end = begin + min(right, len(across) - 1)
            if begin + left > end:
                continue
            place = _place_of(begin + left, cells, firsts)
            while place < len(cells) and cells[place] <= end:
                # Written in any case, and counted if it is to be kept. An index without a sign is
                # never counted from the end of an array, and need not be looked at.
                own, column = np.uintp(count), np.uintp(cells[np.uintp(place)] - begin)
                places[own] = place
                picked[_X, own] = level * across[column, _X]
                picked[_Y, own] = level * across[column, _Y]
                picked[_Z, own] = height
                count += ranges[np.uintp(place)] > nearest
                place += 1
    return count


@compiled()
def _meet(solid: Solid, picked: Floats, distances: Floats, count: int) -> None:
    """Fill in how far the first `count` of the picked rays go to a solid."""
    if solid.shape == BOX:
        _enter_box(solid.axes, solid.half, solid.start, picked, distances, count)
        return
    for n in range(count):
        distances[n] = _entry_of_round(solid, (picked[0, n], picked[1, n], picked[2, n]))


@compiled()
def _take(
    ranges: Floats,
    ids: Integers,
    places: Integers,
    distances: Floats,
    count: int,
    owner: int,
    reach: float,
) -> None:
    """Let the first `count` of the picked rays end at the solid of a body where it is nearer."""
    for n in range(count):
        place, distance = places[n], distances[n]
        is_nearer = distance < ranges[place] and distance <= reach
        ranges[place] = distance if is_nearer else ranges[place]
        ids[place] = owner if is_nearer else ids[place]


@compiled()
def _ray(across: Floats, down: Floats, row: int, column: int) -> Vector:
    """The direction of a cell, a unit vector in the frame of the sensor."""
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
def _enter_box(
    axes: Axes, half: Vector, start: Vector, picked: Floats, distances: Floats, count: int
) -> None:
    """Fill in the `distances` (n,) along unit rays (3, n) to a box, inf without an entry."""
    # Without branches, so that the compiler computes several rays at once.
    for n in range(count):
        ray = picked[0, n], picked[1, n], picked[2, n]
        sides = _common(
            _slab(start[0], dot(axes[0], ray), half[0]), _slab(start[1], dot(axes[1], ray), half[1])
        )
        distances[n] = _if_entered(_common(sides, _slab(start[2], dot(axes[2], ray), half[2])))


@compiled(error_model="numpy")
def _entry_of_round(solid: Solid, ray: Vector) -> float:
    """Distance along a unit ray of the sensor's frame to a cylinder or a sphere, inf without an
    entry.
    """
    # The ray in the frame of the part: from (u, v, w) along (x, y, z).
    u, v, w = solid.start
    x, y, z = dot(solid.axes[0], ray), dot(solid.axes[1], ray), dot(solid.axes[2], ray)
    half = solid.half
    if solid.shape == CYLINDER:
        return _if_entered(_common(_tube(u, v, x, y, half[0]), _slab(w, z, half[2])))
    return _if_entered(_ball(u, v, w, x, y, z, half[0]))


@compiled()
def _if_entered(stretch: Stretch) -> float:
    """Where a ray enters, inf where it does not."""
    # Negative where the ray starts inside or beyond: neither is an entry.
    near, far = stretch
    return near if 0.0 <= near <= far else math.inf


@compiled()
def _common(one: Stretch, other: Stretch) -> Stretch:
    """The stretch that two have in common."""
    return max(one[0], other[0]), min(one[1], other[1])


@compiled(error_model="numpy")
def _slab(start: float, along: float, half: float) -> Stretch:
    """The stretch of a ray between the planes at -half and half."""
    one, other = (-half - start) / along, (half - start) / along
    near, far = min(one, other), max(one, other)
    # A ray along the planes is between them everywhere or nowhere; 0 / 0 must not decide it.
    if along == 0.0:
        near = -math.inf if abs(start) <= half else math.inf
        far = -near
    return near, far


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
