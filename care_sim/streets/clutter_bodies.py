"""The bodies of clutter: kerbs and verges, vegetation, poles and signs, parts of walls.

None is reported. All are made of upright boxes and cylinders, which both engines cast. A slope is a
flight of low steps, a bush or a crown a heap of leafy boxes with gaps. Sizes are in metres. Each
number has its source or the word "choice" beside it.

Each kind has `VARIANTS`, drawn once for all streets. Engines cache bodies, and a street of a
thousand different ones would take seconds.
"""

from collections.abc import Callable
from functools import cache

import numpy as np

from care_sim.streets.layouts import Range, draw
from care_sim.world.bodies import (
    CONCRETE,
    DARK_PAINT,
    LEAVES,
    LIGHT_PAINT,
    TIMBER,
    BodyKind,
    Part,
    Triple,
)

GREY, GREEN, BROWN = (0.5, 0.5, 0.5), (0.2, 0.42, 0.2), (0.35, 0.25, 0.18)

KERB_M: Range = (0.06, 0.14)
"""Height of a kerb: 12 cm is usual (RASt 06), with worn and older ones about it (choice)."""
LOWERED_M = 0.03
"""A kerb where vehicles drive over it (RASt 06)."""
VERGE_RISE_M: Range = (-0.05, 0.8)
"""From the kerb's height to the ground at a house: from level to a slope of 1 in 4 (choice)."""
STEP_M = 0.4
"""Depth of the steps that stand for a slope (choice): a ray meets at most a fifth of the rise."""

BUSH_RADIUS_M: Range = (0.35, 1.1)
BUSH_HEIGHT_M: Range = (0.5, 2.0)
"""From ground cover to hedges that hide a garden (choice); neighbour law allows less than 2 m."""
CLUMP_M: Range = (0.15, 0.5)
"""Side of a clump of leaves in a bush (choice)."""
TRUNK_M: Range = (0.15, 0.5)
"""Diameter of a trunk: from a planted street tree (at least 16 to 18 cm round, FLL) to a grown
one.
"""
CROWN_FROM_M: Range = (1.5, 4.5)
"""Clearance above a carriageway is 4.5 m, above a pavement 2.5 m (RASt 06). Not every tree is cut:
a crown in the sweep of Argoverse 2 hangs to 1.6 m.
"""
CROWN_RADIUS_M: Range = (1.2, 3.2)
CROWN_CLUMP_M: Range = (0.3, 0.9)
CROWN_CLUMPS = 40
"""Fills a fifth of a middling crown, so that rays pass (choice)."""

BED_CHANCE = 0.5
BED_M: Range = (2.0, 4.0)
BED_WIDTH_M: Range = (0.6, 1.1)
BED_HEIGHT_M: Range = (0.3, 0.9)
"""Plants at the foot of every second tree (choice). FLL requires open ground of 6 m^2 about a
street tree. The tree in the sweep of Argoverse 2 has plants 3 m long and 0.9 m high.
"""
BED_CLUMPS = 6

LAMP_M: Range = (0.12, 0.2)
SIGN_POST_M = 0.076
"""Diameter of a usual sign post, 76 mm."""
SIGN_FROM_M = 2.2
SIGN_M: Range = (0.42, 0.75)
"""A sign hangs this high above a pavement (VwV-StVO, Sec. 39) and is 42 to 75 cm wide (sizes 1 to
3)."""
BOLLARD_M: Range = (0.08, 0.2)

VARIANTS = 24


@cache
def variants(make: Callable[[np.random.Generator], BodyKind]) -> tuple[BodyKind, ...]:
    """The bodies of a kind that streets are strewn with."""
    rng = np.random.default_rng([*make.__name__.encode()])
    return tuple(make(rng) for _ in range(VARIANTS))


def slab(length: float, width: float, height: float) -> BodyKind:
    """A piece of pavement, whose inner edge is the kerb."""
    return _body("pavement", _box((0, 0), (length, width), (0.0, height), GREY, CONCRETE))


def verge(length: float, width: float, start: float, rise: float) -> BodyKind:
    """Ground that rises from `start` by `rise` along +y over its `width`, in steps."""
    steps = max(1, round(width / STEP_M))
    depth = width / steps
    parts = []
    for step in range(steps):
        y = (step + 0.5) * depth - width / 2
        top = max(LOWERED_M, start + rise * (step + 0.5) / steps)
        parts.append(_box((0, y), (length, depth), (0.0, top), GREEN, LEAVES))
    return _body("verge", *parts)


def bush(rng: np.random.Generator) -> BodyKind:
    """A bush: clumps of leaves from the ground up."""
    radius, height = draw(rng, BUSH_RADIUS_M), draw(rng, BUSH_HEIGHT_M)
    clumps = int(rng.integers(6, 15))
    middle = (0.0, 0.0, height / 2)
    return _body("bush", *_leaves(rng, clumps, CLUMP_M, middle, (radius, radius, height / 2)))


def tree(rng: np.random.Generator) -> BodyKind:
    """A trunk, and a crown that lets rays through; at its foot a bed of plants or none."""
    across, base, radius = draw(rng, TRUNK_M), draw(rng, CROWN_FROM_M), draw(rng, CROWN_RADIUS_M)
    high = radius * draw(rng, (0.8, 1.4))
    trunk = Part(
        "cylinder", (across, across, base + 0.5), (0.0, 0.0, (base + 0.5) / 2), BROWN, TIMBER
    )
    spread = (radius, radius, high)
    crown = _leaves(rng, CROWN_CLUMPS, CROWN_CLUMP_M, (0.0, 0.0, base + high), spread)
    if rng.random() < BED_CHANCE:
        length, width = draw(rng, BED_M), draw(rng, BED_WIDTH_M)
        bed = _plants(rng, length, width, draw(rng, BED_HEIGHT_M))
        return _body("tree", trunk, *crown, *bed, footprint=(length, width))
    return _body("tree", trunk, *crown, footprint=(across, across))


def lamp(rng: np.random.Generator) -> BodyKind:
    """A lamp post."""
    return _body("lamp post", _post(draw(rng, LAMP_M), draw(rng, (4.0, 8.0))))


def sign(rng: np.random.Generator) -> BodyKind:
    """A traffic sign that faces along the road."""
    side = draw(rng, SIGN_M)
    low = SIGN_FROM_M
    plate = _box((0, 0), (0.03, side), (low, low + side), GREY, LIGHT_PAINT)
    return _body("sign", _post(SIGN_POST_M, low + side), plate, footprint=(SIGN_POST_M,) * 2)


def bollard(rng: np.random.Generator) -> BodyKind:
    """A bollard or a short post."""
    return _body("bollard", _post(draw(rng, BOLLARD_M), draw(rng, (0.8, 1.1))))


def cabinet(rng: np.random.Generator) -> BodyKind:
    """A box of the telephone or the power company."""
    return _block(rng, "cabinet", (0.6, 1.4), (0.3, 0.5), (0.9, 1.5), LIGHT_PAINT)


def bin_(rng: np.random.Generator) -> BodyKind:
    """A wheeled bin of 120 or 240 litres (EN 840-1: 0.48 x 0.55 x 0.94 to 0.58 x 0.74 x 1.08)."""
    return _block(rng, "bin", (0.55, 0.74), (0.48, 0.58), (0.94, 1.08), DARK_PAINT)


def bench(rng: np.random.Generator) -> BodyKind:
    """A bench with its back to the houses."""
    length = draw(rng, (1.2, 2.0))
    seat = _box((0, 0), (length, 0.5), (0.3, 0.47), BROWN, TIMBER)
    return _body("bench", seat, _box((0, 0.25), (length, 0.08), (0.45, 0.85), BROWN, TIMBER))


def board(rng: np.random.Generator) -> BodyKind:
    """A board before a shop."""
    return _block(rng, "board", (0.3, 0.6), (0.5, 0.7), (0.9, 1.3), TIMBER)


def column(rng: np.random.Generator) -> BodyKind:
    """A column for posters, 1.2 to 1.4 m across."""
    return _body("column", _post(draw(rng, (1.1, 1.4)), draw(rng, (2.6, 3.4))))


def relief(rng: np.random.Generator) -> BodyKind:
    """Return a part that juts out of a front: a bay, a frame, a pilaster, a door with its step."""
    width, deep = draw(rng, (0.3, 2.5)), draw(rng, (0.06, 0.45))
    low = draw(rng, (0.0, 1.2))
    high = low + draw(rng, (0.5, 4.0))
    parts = [_box((0, 0), (width, deep), (low, high), GREY, CONCRETE)]
    if rng.random() < 0.25:
        parts.append(_box((0, 0), (width + 0.3, deep + 0.4), (0.0, 0.3), GREY, CONCRETE))
    return _body("relief", *parts)


def _leaves(
    rng: np.random.Generator, count: int, clump: Range, middle: Triple, spread: Triple
) -> list[Part]:
    """Leafy boxes, spread evenly over an ellipsoid with these half axes, none below the ground."""
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places = ways * rng.random((count, 1)) ** (1 / 3) * spread + middle
    sides = rng.uniform(*clump, (count, 3))
    parts = []
    for (x, y, z), (length, width, height) in zip(places.tolist(), sides.tolist(), strict=True):
        low = max(z - height / 2, 0.0)
        parts.append(_box((x, y), (length, width), (low, low + height), GREEN, LEAVES))
    return parts


def _plants(rng: np.random.Generator, length: float, width: float, height: float) -> list[Part]:
    """A bed of plants along x, up to so high."""
    step = length / BED_CLUMPS
    parts = []
    for n in range(BED_CLUMPS):
        size = step, width * draw(rng, (0.6, 1.0))
        middle = (n + 0.5) * step - length / 2, 0.0
        parts.append(_box(middle, size, (0.0, height * draw(rng, (0.5, 1.0))), GREEN, LEAVES))
    return parts


def _block(
    rng: np.random.Generator, name: str, x: Range, y: Range, z: Range, material: str
) -> BodyKind:
    size = draw(rng, x), draw(rng, y)
    return _body(name, _box((0, 0), size, (0.0, draw(rng, z)), GREY, material))


def _post(across: float, height: float) -> Part:
    return Part("cylinder", (across, across, height), (0.0, 0.0, height / 2), GREY, CONCRETE)


def _box(
    middle: tuple[float, float],
    size: tuple[float, float],
    z: Range,
    colour: Triple,
    material: str,
) -> Part:
    low, high = z
    whole = (size[0], size[1], high - low)
    return Part("box", whole, (middle[0], middle[1], (low + high) / 2), colour, material)


def _body(name: str, *parts: Part, footprint: tuple[float, float] | None = None) -> BodyKind:
    """A body of parts. Its footprint is what must stay free on the ground; what holds all parts,
    unless given.
    """
    reach = [
        2 * max(abs(part.centre[axis]) + part.size[axis] / 2 for part in parts) for axis in (0, 1)
    ]
    length, width = footprint or (reach[0], reach[1])
    height = max(part.centre[2] + part.size[2] / 2 for part in parts)
    return BodyKind(name, None, (length, width, height), parts)
