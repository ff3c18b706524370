"""Pictures of body ids, compiled: silhouettes of convex polyhedra drawn into a depth buffer.

All polyhedra of a row, then the next row: the depth buffer is a line, which stays in the cache of
the processor, and boxes are read off it there. Where columns are counted as unsigned numbers,
compiled code need not look at each whether it counts from the end, and takes several at a time.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.silhouette_kernels import (
    LOT,
    Silhouettes,
    lay_silhouettes,
    room_for,
)
from care_sim.sensors.engines.view_kernels import Lens, Meshes, PlacedCamera
from care_sim.world.body_tables import Tables
from care_sim.world.bullet import NO_BODY, PixelWindow


@compiled()
def visible_boxes(ids: Integers) -> Integers:
    """The table of the boxes in a picture of ids (height, width), in ascending order."""
    # One row per possible id: ids are small, and a table is faster than a search.
    rows, columns = ids.shape
    highest = NO_BODY
    for row in range(rows):
        for column in range(columns):
            highest = max(highest, ids[row, column])
    found = np.zeros((highest + 1, 6), np.int64)

    # Stretch by stretch of equal ids, of which there are far fewer than pixels.
    for row in range(rows):
        column = 0
        while column < columns:
            body, first = ids[row, column], column
            while column < columns and ids[row, column] == body:
                column += 1
            if body != NO_BODY:
                note_pixels(found, body, row, first, column, column - first)
    return found[found[:, 5] > 0]


def boxes_of_window(ids: Integers, window: PixelWindow) -> Integers:
    """The table of the boxes in the ids of a window, counted from the corner of the picture."""
    left, top, _, _ = window
    boxes: Integers = visible_boxes(ids) + np.array([0, left, top, left, top, 0])
    return boxes


@compiled()
def note_pixels(found: Integers, body: int, row: int, first: int, end: int, pixels: int) -> None:
    """Add a body's `pixels`, from column `first` to the one before `end`, to the table `found`.
    `found` has a row for every possible id, zeros at first. Call it in the order of picture rows.
    """
    if found[body, 5] == 0:
        found[body, 0], found[body, 1], found[body, 2] = body, first, row
    # The top stays as it began, and the bottom is this row's.
    found[body, 1] = min(found[body, 1], first)
    found[body, 3] = max(found[body, 3], end)
    found[body, 4] = row + 1
    found[body, 5] += pixels


@compiled()
def moved_up(found: Integers) -> int:
    """Move the rows of `found` that have pixels to its beginning; how many they are."""
    filled = 0
    for n in range(len(found)):
        if found[n, 5] > 0:
            for k in range(6):
                found[filled, k] = found[n, k]
            filled += 1
    return filled


_LOTS = np.uint64(2**64 - LOT)
"""The bits of a column that say in which lot it is."""


class Line(NamedTuple):
    """A row of a picture, by column: `ids` of bodies, NO_BODY where none is, the `inverse_depths`
    of what is seen, 1 / m, and room for those of one polyhedron, `surface`. There are a lot of
    columns more than in the picture.
    """

    ids: Integers
    inverse_depths: Floats
    surface: Floats


View = tuple[
    tuple[Floats, Floats],
    tuple[float, float, float],
    PixelWindow,
    tuple[float, float],
    Tables,
    Floats,
]
"""Inputs of a picture: the fields of `PlacedCamera` and of `Lens`. Then the drawn window (left,
top, right, bottom), the least and the greatest depth in metres, the fields of `Meshes`, and the
poses (m, 7) of bodies by id.
"""


@compiled()
def render_bodies(view: View) -> Integers:
    """(height, width) body ids of the pixels of a window, NO_BODY where none is."""
    left, top, right, bottom = view[2]
    picture = np.empty((bottom - top, right - left), np.int64)
    _drawn(view, picture)
    return picture


@compiled()
def bodies_in_view(view: View) -> Integers:
    """The table of boxes (`visible_boxes`) of all that `render_bodies` would draw, counted from the
    corner of the picture.
    """
    return _drawn(view, np.empty((0, 0), np.int64))


@compiled()
def _drawn(view: View, picture: Integers) -> Integers:
    """The table of boxes; see `draw_silhouettes` for the `picture`."""
    # Fields get their names here: numba takes microseconds to type each named tuple of Python, and
    # next to none for plain ones.
    camera, lens, window, depths, meshes, poses = view
    table = Meshes(*meshes)
    _, top, right, bottom = window
    counts = len(table.owners), len(table.faces), len(table.edges)
    seen = room_for(counts, right, bottom - top)
    line = empty_line(right, depths)
    found = np.empty((len(poses), 6), np.int64)
    lay_silhouettes(PlacedCamera(*camera), Lens(*lens), window, depths, table, poses, seen)
    return found[: draw_silhouettes(seen, window, depths, line, found, picture)]


@compiled()
def empty_line(columns: int, depths: tuple[float, float]) -> Line:
    """A line on which nothing is seen up to the greater of two depths."""
    room = columns + LOT
    return Line(np.full(room, NO_BODY), np.full(room, 1.0 / depths[1]), np.empty(room))


@compiled()
def draw_silhouettes(
    seen: Silhouettes,
    window: PixelWindow,
    depths: tuple[float, float],
    line: Line,
    found: Integers,
    picture: Integers,
) -> int:
    """Fill the table `found` (m, 6) with the boxes of what is seen of m bodies, and return how many
    they are. The ids go into the `picture` (height, width), unless it is empty.

    The `line` is empty, and is so again afterwards.
    """
    # Fields get names of their own: to ask a tuple for an array counts references each time.
    ids, inverse_depths, surface = line.ids, line.inverse_depths, line.surface
    owners, facing, starts, numbers = seen.owners, seen.facing, seen.starts, seen.numbers
    counts, crossed, stretches = seen.counts, seen.crossed, seen.stretches
    left, top, right, bottom = window
    greatest, least = 1.0 / depths[0], 1.0 / depths[1]
    found[:] = 0
    for row in range(bottom - top):
        for n in range(counts[row]):
            first, end = stretches[row, n, 0], stretches[row, n, 1]
            place = crossed[row, n]
            faces = starts[place], starts[place + 1]
            _lay_surface(first, end, top + row + 1.0, facing, faces, numbers, surface)
            _take_nearer(first, end, owners[place], greatest, ids, inverse_depths, surface)
        _read_row(row, top, counts[row], crossed, stretches, owners, ids, found)
        if len(picture):
            for column in range(left, right):
                picture[row, column - left] = ids[column]
        first, end = right, left
        for n in range(counts[row]):
            first, end = min(first, stretches[row, n, 0]), max(end, stretches[row, n, 1])
        low, high = _in_lots(first, end)
        for column in range(low, high):
            ids[column], inverse_depths[column] = NO_BODY, least
    return moved_up(found)


@compiled()
def _in_lots(first: int, end: int) -> tuple[np.uint64, np.uint64]:
    """A stretch of columns, widened to whole lots: none is left over to be taken alone. For work
    that does no harm beside the stretch.
    """
    return np.uint64(first) & _LOTS, np.uint64(end + LOT - 1) & _LOTS


@compiled()
def _lay_surface(
    first: int,
    end: int,
    v: float,
    facing: Floats,
    faces: tuple[int, int],
    numbers: Floats,
    surface: Floats,
) -> None:
    """Fill `surface` at least from the column `first` to the one before `end` with the inverse
    depths of a polyhedron in the row at `v`. Its faces are those of `facing` from the first number
    of `faces` to the one before the second.
    """
    # A ray is inside a convex body once it has passed all planes that face the camera. The farthest
    # of them has the least inverse depth. Three faces at once, and several pixels.
    low, high = _in_lots(first, end)
    for n in range(faces[0], faces[1], 3):
        a, b, c = facing[n, 0], facing[n + 1, 0], facing[n + 2, 0]
        a_down, b_down, c_down = facing[n, 1] * v, facing[n + 1, 1] * v, facing[n + 2, 1] * v
        a_start, b_start, c_start = facing[n, 2], facing[n + 1, 2], facing[n + 2, 2]
        for column in range(low, high):
            u = numbers[column]
            least = math.inf if n == faces[0] else surface[column]
            least = min(least, a_start + a * u + a_down)
            least = min(least, b_start + b * u + b_down)
            surface[column] = min(least, c_start + c * u + c_down)


@compiled()
def _take_nearer(
    first: int,
    end: int,
    owner: int,
    greatest: float,
    ids: Integers,
    inverse_depths: Floats,
    surface: Floats,
) -> None:
    """The depth test from the column `first` to the one before `end`: what is nearer than all
    before it, at an inverse depth of at most `greatest`, takes the pixel. The later of two parts
    with equal depths takes it.
    """
    for column in range(np.uint64(first), np.uint64(end)):
        depth = inverse_depths[column]
        is_seen = depth <= surface[column] <= greatest
        inverse_depths[column] = surface[column] if is_seen else depth
        ids[column] = owner if is_seen else ids[column]


@compiled()
def _read_row(
    row: int,
    top: int,
    count: int,
    crossed: Integers,
    stretches: Integers,
    owners: Integers,
    ids: Integers,
    found: Integers,
) -> None:
    """Add the line `ids` of a window's row to a table of boxes. The window begins at the row `top`
    of the picture. Other arguments are as in `Silhouettes`.
    """
    n = 0
    while n < count:
        # The parts of a body stand side by side. Its pixels lie between the ends of its stretches.
        owner = owners[crossed[row, n]]
        first, end = stretches[row, n, 0], stretches[row, n, 1]
        n += 1
        while n < count and owners[crossed[row, n]] == owner:
            first = min(first, stretches[row, n, 0])
            end = max(end, stretches[row, n, 1])
            n += 1
        pixels = 0
        low, high = _in_lots(first, end)
        for column in range(low, high):
            pixels += ids[column] == owner
        if pixels > 0:
            while ids[first] != owner:
                first += 1
            while ids[end - 1] != owner:
                end -= 1
            note_pixels(found, owner, top + row, first, end, pixels)
