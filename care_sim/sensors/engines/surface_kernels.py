"""Which part of a body a ray met, and how obliquely, compiled.

It is read off the place that the ray met, whichever engine cast it. So a scan that asks for no
surfaces pays nothing.
"""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.geometry_kernels import Vector, body_axes, dot
from care_sim.sensors.engines.solid_kernels import BOX, CYLINDER
from care_sim.sensors.engines.window_kernels import Parts

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
    """The nearer of the two planes at -half and half, of which all is told across them."""
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
