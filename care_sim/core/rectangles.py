"""The cells of dilated angular rectangles, compiled: what hulls and wedges come down to (paper, Remark 2)."""

import math

import numpy as np

from care_sim.base.compiled import compiled


@compiled()
def silhouettes(boxes):  # type: ignore[no-untyped-def]
    """What of boxes (n, 7) bounds their hulls, seen from the origin, and which of them stand around it.

    Returns x and y (n, 5, 2) of the centre and the four corners, and (n, 2, 2) the heights of bottom and top, each
    with the distance in the x, y plane at which it is lowest or highest: of the nearest or the farthest point.
    """
    planar, upright = np.empty((len(boxes), 5, 2)), np.empty((len(boxes), 2, 2))
    around = np.empty(len(boxes), np.bool_)
    for n, (x, y, z, length, width, height, yaw) in enumerate(boxes):
        cos, sin = math.cos(yaw), math.sin(yaw)
        beyond = abs(cos * x + sin * y) - length / 2, abs(sin * x - cos * y) - width / 2
        near, far = math.hypot(max(beyond[0], 0.0), max(beyond[1], 0.0)), 0.0
        planar[n, 0] = x, y
        for k, (front, left) in enumerate(((0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5))):
            along, across = front * length, left * width
            corner = x + (cos * along - sin * across), y + (sin * along + cos * across)
            planar[n, k + 1], far = corner, max(far, math.hypot(corner[0], corner[1]))
        bottom, top = z - height / 2, z + height / 2
        upright[n, 0] = bottom, near if bottom < 0 else far
        upright[n, 1] = top, near if top > 0 else far
        around[n] = near <= 0.0
    return planar, upright, around


@compiled()
def sectors(azimuths, elevations, azimuth_margins, elevation_margin, lattice):  # type: ignore[no-untyped-def]
    """The cells of n rectangles one after the other, each ascending, and (n,) where each ends.

    A rectangle holds the `azimuths` (n, j) of its row, which lie within half a turn of the first, and the `elevations`
    (n, k), dilated by `azimuth_margins` (n,) columns and `elevation_margin` rows. `lattice` is the grid's columns,
    rows, column width, top and row height.
    """
    bounds, ends = np.empty((len(azimuths), 4), np.int64), np.empty(len(azimuths), np.int64)
    size = 0
    for n in range(len(azimuths)):
        first, stop = bounds[n, 0], bounds[n, 1] = _columns(azimuths[n], azimuth_margins[n], lattice)
        upper, lower = bounds[n, 2], bounds[n, 3] = _rows(elevations[n], elevation_margin, lattice)
        size += (stop - first) * (lower - upper)
        ends[n] = size
    cells = np.empty(size, np.int64)
    place = 0
    for bound in bounds:
        place = _lay(cells, place, bound, lattice[0])
    return cells, ends


@compiled()
def _columns(azimuths, margin, lattice):  # type: ignore[no-untyped-def]
    """First column, on the grid, and the one after the last, up to a turn beyond it."""
    columns, _, width, _, _ = lattice
    middle, right, left = azimuths[0], math.inf, -math.inf
    for azimuth in azimuths:
        offset = (azimuth - middle + math.pi) % (2 * math.pi) - math.pi
        right, left = min(right, offset), max(left, offset)
    first = math.floor((middle + right + math.pi) / width) - margin
    last = math.floor((middle + left + math.pi) / width) + margin
    return first % columns, first % columns + max(0, min(last - first + 1, columns))


@compiled()
def _rows(elevations, margin, lattice):  # type: ignore[no-untyped-def]
    """First row and the one after the last."""
    _, rows, _, top, height = lattice
    upper = math.floor((top - elevations.max()) / height + 0.5) - margin
    lower = math.floor((top - elevations.min()) / height + 0.5) + margin
    first = min(max(upper, 0), rows)
    return first, max(first, min(lower + 1, rows))


@compiled()
def _lay(cells, place, bounds, columns):  # type: ignore[no-untyped-def]
    """Write a rectangle's cells from `place` on, in every row those beyond the seam first; the place after them."""
    first, stop, upper, lower = bounds
    for row in range(upper, lower):
        for column in range(columns, stop):
            cells[place] = row * columns + column - columns
            place += 1
        for column in range(first, min(stop, columns)):
            cells[place] = row * columns + column
            place += 1
    return place
