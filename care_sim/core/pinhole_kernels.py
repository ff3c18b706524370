"""The pinhole model of cameras, compiled: points to pixels, pixels to rays, and what forecasts explain (Eq. 2).

A lens is a tuple: its position (3,) and axes (3, 3) in the sensor frame, focal length () and centre (2,) in pixels.
`lenses` holds the same of k cameras, each with an axis of k before it.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled

_BOX_POINTS = ((2, 2), (0, 0), (0, 1), (1, 0), (1, 1), (3, 0), (3, 1), (0, 3), (1, 3))
"""Points of an image box: which of low, high, middle and nearest to the principal point across, and which down."""


@compiled()
def project(points, lens):  # type: ignore[no-untyped-def]
    """Pixels (n, 2) and depths (n,) of points (n, 3)."""
    pixels, depths = np.empty((len(points), 2)), np.empty(len(points))
    for n, (x, y, z) in enumerate(points):
        pixels[n, 0], pixels[n, 1], depths[n] = _pixel(x, y, z, lens)
    return pixels, depths


@compiled()
def rays(pixels, lens):  # type: ignore[no-untyped-def]
    """Directions (n, 3) through pixels (n, 2)."""
    directions = np.empty((len(pixels), 3))
    for n, (u, v) in enumerate(pixels):
        directions[n] = _ray(u, v, lens)
    return directions


@compiled()
def box_rays(boxes, cameras, lenses):  # type: ignore[no-untyped-def]
    """(n, 9, 3) rays through image boxes (n, 4) of `cameras` (n,); see `care_sim.core.pinhole.PinholeCamera.box_rays`."""
    bundles = np.empty((len(boxes), len(_BOX_POINTS), 3))
    for n, (left, top, right, bottom) in enumerate(boxes):
        lens = _of(lenses, cameras[n])
        centre = lens[3]
        across = left, right, (left + right) / 2, min(max(centre[0], left), right)
        down = top, bottom, (top + bottom) / 2, min(max(centre[1], top), bottom)
        for k, (i, j) in enumerate(_BOX_POINTS):
            bundles[n, k] = _ray(across[i], down[j], lens)
    return bundles


@compiled()
def explainers(detections, forecasts, lenses):  # type: ignore[no-untyped-def]
    """(n,) the row of the first same-class forecast whose centre each image box holds (Eq. 2), -1 without one.

    `detections` are their boxes (n, 4), classes, cameras and how far the car has turned since their pictures;
    `forecasts` their centres (m, 3) and classes.
    """
    boxes, classes, cameras, yaw_changes = detections
    centres, kinds = forecasts
    found = np.full(len(boxes), -1)
    for n, (left, top, right, bottom) in enumerate(boxes):
        lens, cos, sin = _of(lenses, cameras[n]), math.cos(yaw_changes[n]), math.sin(yaw_changes[n])
        for m, (x, y, z) in enumerate(centres):
            if kinds[m] == classes[n]:
                u, v, _ = _pixel(cos * x - sin * y, sin * x + cos * y, z, lens)
                if left <= u <= right and top <= v <= bottom:
                    found[n] = m
                    break
    return found


@compiled()
def rectangles(boxes, lens, nearest):  # type: ignore[no-untyped-def]
    """(n, 4) what 3D boxes (n, 7) span in the picture; see `care_sim.core.pinhole.PinholeCamera.project_boxes`."""
    spans, corners = np.empty((len(boxes), 4)), np.empty((8, 3))
    for n, box in enumerate(boxes):
        _lay_corners(box, lens, corners)
        span = math.inf, math.inf, -math.inf, -math.inf
        for one in range(8):
            if corners[one, 0] >= nearest:
                span = _widened(span, corners[one], lens)
            for axis in range(3):
                other = one ^ 1 << axis
                if corners[one, 0] < nearest <= corners[other, 0]:
                    share = (nearest - corners[one, 0]) / (corners[other, 0] - corners[one, 0])
                    span = _widened(span, corners[one] + (corners[other] - corners[one]) * share, lens)
        spans[n] = span if span[0] <= span[2] else (math.nan, math.nan, math.nan, math.nan)
    return spans


@compiled()
def window_around(spans, width, height):  # type: ignore[no-untyped-def]
    """Left, top, right, bottom: the whole pixels of a picture that hold `spans` (n, 4), and one more on each side."""
    left, top, right, bottom = width, height, 0, 0
    for span in spans:
        if span[0] <= span[2]:
            low = max(math.floor(span[0]) - 1, 0), max(math.floor(span[1]) - 1, 0)
            high = min(math.ceil(span[2]) + 1, width), min(math.ceil(span[3]) + 1, height)
            if low[0] < high[0] and low[1] < high[1]:
                left, top = min(left, low[0]), min(top, low[1])
                right, bottom = max(right, high[0]), max(bottom, high[1])
    return (left, top, right, bottom) if left < right else (0, 0, 0, 0)


@compiled()
def _lay_corners(box, lens, corners):  # type: ignore[no-untyped-def]
    """Fill `corners` (8, 3: depth, left, up): bit i of a corner's number says on which side of axis i it lies."""
    position, axes, _, _ = lens
    cos, sin = math.cos(box[6]), math.sin(box[6])
    for n in range(8):
        along, across, upward = box[3] * ((n & 1) - 0.5), box[4] * ((n >> 1 & 1) - 0.5), box[5] * ((n >> 2) - 0.5)
        x = box[0] + cos * along - sin * across - position[0]
        y = box[1] + sin * along + cos * across - position[1]
        for i in range(3):
            corners[n, i] = _along(axes[i], x, y, box[2] + upward - position[2])


@compiled()
def _widened(span, point, lens):  # type: ignore[no-untyped-def]
    """A span that holds the pixel of a point (depth, left, up) as well."""
    _, _, focal, centre = lens
    u, v = centre[0] - focal * point[1] / point[0], centre[1] - focal * point[2] / point[0]
    return min(span[0], u), min(span[1], v), max(span[2], u), max(span[3], v)


@compiled(boundscheck=True)
def _of(lenses, camera):  # type: ignore[no-untyped-def]
    """The lens of a camera. Raises IndexError for one that there is not."""
    positions, axes, focals, centres = lenses
    return positions[camera], axes[camera], focals[camera], centres[camera]


@compiled()
def _pixel(x, y, z, lens):  # type: ignore[no-untyped-def]
    """Pixel and depth of a point; none, NaN, at or behind the image plane."""
    position, axes, focal, centre = lens
    x, y, z = x - position[0], y - position[1], z - position[2]
    depth, left, up = _along(axes[0], x, y, z), _along(axes[1], x, y, z), _along(axes[2], x, y, z)
    scale = focal / depth if depth > 0 else math.nan
    return centre[0] - left * scale, centre[1] - up * scale, depth


@compiled()
def _ray(u, v, lens):  # type: ignore[no-untyped-def]
    """Not normalised."""
    _, axes, focal, centre = lens
    left, up = (centre[0] - u) / focal, (centre[1] - v) / focal
    return (
        axes[0, 0] + left * axes[1, 0] + up * axes[2, 0],
        axes[0, 1] + left * axes[1, 1] + up * axes[2, 1],
        axes[0, 2] + left * axes[1, 2] + up * axes[2, 2],
    )


@compiled()
def _along(axis, x, y, z):  # type: ignore[no-untyped-def]
    return axis[0] * x + axis[1] * y + axis[2] * z
