"""Unit rays against the parts of bodies: boxes, cylinders and spheres, compiled.

A box is cut out by three slabs (Kay and Kajiya 1986), a cylinder by a tube and a slab. A ray that
starts inside a solid does not enter it: Bullet's rays answer the same.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.geometry_kernels import Axes, Vector, body_axes, dot
from care_sim.sensors.engines.window_kernels import Parts

BOX, CYLINDER, SPHERE = range(3)
"""Places in `care_sim.world.body_tables.SHAPES`."""

Stretch = tuple[float, float]
"""Where a ray enters and leaves, as distances along it; the first is the larger where it misses."""


class Solid(NamedTuple):
    """A part as rays meet it: its `axes` in the frame of the sensor, its half extents `half`, and
    the sensor in the frame of the part, `start`.
    """

    shape: int
    axes: Axes
    half: Vector
    start: Vector


@compiled()
def solid_of(part: int, parts: Parts, centres: Floats, axes: Floats) -> Solid:
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


@compiled()
def meet(solid: Solid, picked: Floats, distances: Floats, count: int) -> None:
    """Fill in how far the first `count` of the picked rays go to a solid."""
    if solid.shape == BOX:
        _enter_box(solid.axes, solid.half, solid.start, picked, distances, count)
        return
    for n in range(count):
        distances[n] = _entry_of_round(solid, (picked[0, n], picked[1, n], picked[2, n]))


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


SAME_SURFACE_M = 0.001
"""A place this near to two faces may lie on either: Bullet's rays end within a millimetre of round
parts."""
Surface = tuple[float, float]
"""How far a place is outside a surface in metres, below 0 inside, and the cosine of the angle of
incidence there, below 0 where the surface faces away."""


@compiled()
def met_surfaces(
    places: Floats,
    rays: Floats,
    bodies: Integers,
    poses: Floats,
    parts: tuple[Integers, Floats, Floats, Integers],
) -> tuple[Integers, Floats]:
    """The parts (n,) that rays met, and the cosines (n,) of the angles between each ray and the
    normal of the surface.

    `places` (n, 3) are where unit `rays` (n, 3) met `bodies` (n,) that stood at `poses` (n, 7), all
    in the world. Each body has parts. `parts` holds the fields of `Parts`.
    """
    solids = Parts(*parts)
    found = np.empty(len(places), np.int64)
    cosines = np.zeros(len(places))
    for n, place in enumerate(places):
        pose = poses[n]
        axes = body_axes(pose[3], pose[4], pose[5], pose[6])
        away = place[0] - pose[0], place[1] - pose[1], place[2] - pose[2]
        local = dot(axes[0], away), dot(axes[1], away), dot(axes[2], away)
        ray = dot(axes[0], rays[n]), dot(axes[1], rays[n]), dot(axes[2], rays[n])
        nearest = math.inf
        for part in range(len(solids.owners)):
            if solids.owners[part] != bodies[n]:
                continue
            offset = solids.offsets[part]
            inside = local[0] - offset[0], local[1] - offset[1], local[2] - offset[2]
            gap, cosine = _surface(solids.shapes[part], solids.halves[part], inside, ray)
            if abs(gap) < nearest:
                nearest = abs(gap)
                found[n] = part
                cosines[n] = max(0.0, cosine)
    return found, cosines


@compiled()
def _surface(shape: int, half: Floats, place: Vector, ray: Vector) -> Surface:
    """The surface of a part at a place in its frame."""
    if shape == BOX:
        sides = _outer(_face(place[0], half[0], ray[0]), _face(place[1], half[1], ray[1]))
        return _outer(sides, _face(place[2], half[2], ray[2]))
    if shape == CYLINDER:
        tube = _round(half[0], (place[0], place[1], 0.0), ray)
        return _outer(tube, _face(place[2], half[2], ray[2]))
    return _round(half[0], place, ray)


@compiled()
def _face(place: float, half: float, ray: float) -> Surface:
    """Return the nearer of the two planes at -half and half, by the coordinate across them."""
    return abs(place) - half, -ray if place > 0.0 else ray


@compiled()
def _round(radius: float, place: Vector, ray: Vector) -> Surface:
    """A ball, or with a place in the plane a tube."""
    away = math.sqrt(dot(place, place))
    return away - radius, -dot(place, ray) / max(away, SAME_SURFACE_M)


@compiled()
def _outer(one: Surface, other: Surface) -> Surface:
    """The one of two surfaces of a convex part that the place lies on: it is inside all others. At
    an edge it is the one that faces the ray more.
    """
    if abs(one[0] - other[0]) <= SAME_SURFACE_M:
        return one if one[1] >= other[1] else other
    return one if one[0] > other[0] else other
