"""Rays of a scan against the road and the parts of bodies, compiled."""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import GridSpacing
from care_sim.core.grid import Cells
from care_sim.sensors.engines.geometry_kernels import Vector, dot
from care_sim.sensors.engines.solid_kernels import meet, solid_of
from care_sim.sensors.engines.window_kernels import Parts, SensorPose, place_parts
from care_sim.world.bullet import NO_BODY

_X, _Y, _Z = np.uintp(0), np.uintp(1), np.uintp(2)
_STRIDE_BITS = 5
"""A stride is 2 to the power of this many cells. The first fired cell of each stride is known;
cells within a stride are searched one by one.
"""


class Fan(NamedTuple):
    """Cosine and sine of the azimuth of every column `across` (columns, 2), and of the elevation of
    every row `down` (rows, 2). They are fewer than the directions of all cells, and so nearer at
    hand in the processor's cache.
    """

    across: Floats
    down: Floats


class RoadPlane(NamedTuple):
    """The plane z = 0 of the world. `up` (3,) is the world's up in the sensor frame, `height` the
    sensor's height in metres. `body` is the id of the ground, NO_BODY without ground.
    """

    up: Floats
    height: float
    body: int


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
            solid = solid_of(part, solids, placed.centres, placed.axes)
            meet(solid, picked, distances, count)
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
