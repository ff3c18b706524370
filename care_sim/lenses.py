"""The pinhole model of cameras, compiled: points to pixels, pixels to rays, and what forecasts explain (Eq. 2).

A lens is a tuple: its position (3,) and axes (3, 3) in the sensor frame, focal length () and centre (2,) in pixels.
`lenses` holds the same of k cameras, each with an axis of k before it. Numba's cache notices a change in a compiled
function's own file only, so no other file's compiled code calls these.
"""

import math

import numpy as np
from numba import njit

_BOX_POINTS = ((2, 2), (0, 0), (0, 1), (1, 0), (1, 1), (3, 0), (3, 1), (0, 3), (1, 3))
"""Points of an image box: which of low, high, middle and nearest to the principal point across, and which down."""


@njit(cache=True)
def project(points, lens):  # type: ignore[no-untyped-def]
    """Pixels (n, 2) and depths (n,) of points (n, 3)."""
    pixels, depths = np.empty((len(points), 2)), np.empty(len(points))
    for n, (x, y, z) in enumerate(points):
        pixels[n, 0], pixels[n, 1], depths[n] = _pixel(x, y, z, lens)
    return pixels, depths


@njit(cache=True)
def rays(pixels, lens):  # type: ignore[no-untyped-def]
    """Directions (n, 3) through pixels (n, 2)."""
    directions = np.empty((len(pixels), 3))
    for n, (u, v) in enumerate(pixels):
        directions[n] = _ray(u, v, lens)
    return directions


@njit(cache=True)
def box_rays(boxes, cameras, lenses):  # type: ignore[no-untyped-def]
    """(n, 9, 3) rays through image boxes (n, 4) of `cameras` (n,); see `care_sim.pinhole.PinholeCamera.box_rays`."""
    bundles = np.empty((len(boxes), len(_BOX_POINTS), 3))
    for n, (left, top, right, bottom) in enumerate(boxes):
        lens = _of(lenses, cameras[n])
        centre = lens[3]
        across = left, right, (left + right) / 2, min(max(centre[0], left), right)
        down = top, bottom, (top + bottom) / 2, min(max(centre[1], top), bottom)
        for k, (i, j) in enumerate(_BOX_POINTS):
            bundles[n, k] = _ray(across[i], down[j], lens)
    return bundles


@njit(cache=True)
def matched(detections, forecasts, lenses):  # type: ignore[no-untyped-def]
    """(n,) which image boxes hold the centre of a same-class forecast (Eq. 2).

    `detections` are their boxes (n, 4), classes, cameras and how far the car has turned since their pictures;
    `forecasts` their centres (m, 3) and classes.
    """
    boxes, classes, cameras, yaw_changes = detections
    centres, kinds = forecasts
    found = np.zeros(len(boxes), np.bool_)
    for n, (left, top, right, bottom) in enumerate(boxes):
        lens, cos, sin = _of(lenses, cameras[n]), math.cos(yaw_changes[n]), math.sin(yaw_changes[n])
        for m, (x, y, z) in enumerate(centres):
            if kinds[m] == classes[n]:
                u, v, _ = _pixel(cos * x - sin * y, sin * x + cos * y, z, lens)
                found[n] |= left <= u <= right and top <= v <= bottom
    return found


@njit(cache=True, boundscheck=True)
def _of(lenses, camera):  # type: ignore[no-untyped-def]
    """The lens of a camera. Raises IndexError for one that there is not."""
    positions, axes, focals, centres = lenses
    return positions[camera], axes[camera], focals[camera], centres[camera]


@njit(cache=True)
def _pixel(x, y, z, lens):  # type: ignore[no-untyped-def]
    """Pixel and depth of a point; none, NaN, at or behind the image plane."""
    position, axes, focal, centre = lens
    x, y, z = x - position[0], y - position[1], z - position[2]
    depth, left, up = _along(axes[0], x, y, z), _along(axes[1], x, y, z), _along(axes[2], x, y, z)
    scale = focal / depth if depth > 0 else math.nan
    return centre[0] - left * scale, centre[1] - up * scale, depth


@njit(cache=True)
def _ray(u, v, lens):  # type: ignore[no-untyped-def]
    """Not normalised."""
    _, axes, focal, centre = lens
    left, up = (centre[0] - u) / focal, (centre[1] - v) / focal
    return (
        axes[0, 0] + left * axes[1, 0] + up * axes[2, 0],
        axes[0, 1] + left * axes[1, 1] + up * axes[2, 1],
        axes[0, 2] + left * axes[1, 2] + up * axes[2, 2],
    )


@njit(cache=True)
def _along(axis, x, y, z):  # type: ignore[no-untyped-def]
    return axis[0] * x + axis[1] * y + axis[2] * z
