"""The catalogue of bodies: shapes, sizes, and the sources of sizes.

Body frame: x forward, y left, z up, origin on the ground under the centre. Sizes are length, width,
height in metres. Unless a line says otherwise they are the mean annotated sizes of nuScenes, as in
the anchors of MMDetection3D's configurations for it.
"""

from dataclasses import dataclass, replace
from typing import Literal

DARK_PAINT = "dark paint"
LIGHT_PAINT = "light paint"
GLASS = "glass"
RUBBER = "rubber"
CLOTHING = "clothing"
SKIN = "skin"
TIMBER = "timber"
LEAVES = "leaves"
CONCRETE = "concrete"
ASPHALT = "asphalt"

REFLECTANCES = {
    # The two targets at which data sheets state a range (Ouster, OS1: 10% and 80%) stand for dark
    # and light vehicles: no one figure holds for paint.
    DARK_PAINT: 0.10,
    LIGHT_PAINT: 0.80,
    # Reflection of glass at right angles (Fresnel, index 1.5). It goes one way, so a LiDAR gets at
    # most this much.
    GLASS: 0.04,
    # The middle of the 40 to 60% that targets of pedestrians must have at 850 to 910 nm (ISO
    # 19206-2; ACEA, articulated pedestrian target).
    CLOTHING: 0.50,
    SKIN: 0.50,
    # Typical values at 900 nm, Wehr and Lohr 1999, Airborne laser scanning, Table 2: tyre wall,
    # rough wood, deciduous trees, smooth concrete, asphalt with pebbles.
    RUBBER: 0.02,
    TIMBER: 0.25,
    LEAVES: 0.60,
    CONCRETE: 0.24,
    ASPHALT: 0.17,
}
"""Share of a near-infrared pulse that a surface of each material scatters, 0 to 1, as if in all
directions alike (Lambert). Mirror-like reflection, which paint and glass also have, is left out.
Car LiDARs send at 850 to 905 nm.
"""


Triple = tuple[float, float, float]
Shape = Literal["box", "cylinder", "sphere"]


@dataclass(frozen=True)
class Part:
    """One primitive of a body: full extents `size`, those of the bounding box where it is round.

    `centre` is in the body frame, metres; `colour` is red, green and blue from 0 to 1; `material`
    is one of `care_sim.world.bodies.REFLECTANCES`.
    """

    shape: Shape
    size: Triple
    centre: Triple
    colour: Triple
    material: str = DARK_PAINT


@dataclass(frozen=True)
class BodyKind:
    """A kind of body. `label` is its class name, or None where the five classes do not hold it."""

    name: str
    label: str | None
    size: Triple
    parts: tuple[Part, ...]


BLACK = (0.08, 0.08, 0.09)
TINTED = (0.25, 0.32, 0.38)
LIGHT_GREY = (0.82, 0.82, 0.8)


def _box(
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    colour: Triple,
    material: str = DARK_PAINT,
) -> Part:
    """Return a box by its ends along each axis of the body."""
    size = (x[1] - x[0], y[1] - y[0], z[1] - z[0])
    centre = ((x[1] + x[0]) / 2, (y[1] + y[0]) / 2, (z[1] + z[0]) / 2)
    return Part("box", size, centre, colour, material)


def _two_box(
    name: str,
    label: str,
    size: Triple,
    waist: float,
    cabin: tuple[float, float],
    colour: Triple,
    paint: str = DARK_PAINT,
) -> BodyKind:
    """Return a passenger vehicle: full-length body up to `waist`, and a cabin of glass above it.
    `cabin` holds the cabin's ends, as shares of the length from the rear.
    """
    length, width, height = size
    half, side = length / 2, width / 2
    body = _box((-half, half), (-side, side), (0.0, waist), colour, paint)
    ends = (-half + cabin[0] * length, -half + cabin[1] * length)
    glass = _box(ends, (0.1 - side, side - 0.1), (waist, height), TINTED, GLASS)
    return BodyKind(name, label, size, (body, glass))


def _lorry(
    name: str, label: str | None, size: Triple, cab: float, cab_height: float, colour: Triple
) -> BodyKind:
    """Cab in front (length `cab`) and a box behind it, both down to the ground (side skirts)."""
    length, width, height = size
    half, side = length / 2, width / 2
    walls = (-half, half - cab - 0.1), (-side, side), (0.0, height)
    box = _box(*walls, LIGHT_GREY, LIGHT_PAINT)
    front = _box((half - cab, half), (0.1 - side, side - 0.1), (0.0, cab_height), colour)
    return BodyKind(name, label, size, (box, front))


def _block(
    name: str, label: str | None, size: Triple, colour: Triple, material: str = DARK_PAINT
) -> BodyKind:
    length, width, height = size
    half, side = length / 2, width / 2
    whole = _box((-half, half), (-side, side), (0.0, height), colour, material)
    return BodyKind(name, label, size, (whole,))


def _person(name: str, size: Triple, colour: Triple) -> BodyKind:
    """Two legs one stride apart up to 0.47 of the height (an inseam), torso, and head above the
    chin at 0.87 of it (Drillis and Contini 1966, body segment parameters).
    """
    # One leg forward on the right, the other back on the left: seen from the side they are apart.
    length, width, height = size
    hip, chin = 0.47 * height, 0.87 * height
    leg = 0.16
    legs = [
        Part(
            "cylinder",
            (leg, leg, hip),
            (sign * (length - leg) / 2, -sign * width / 5, hip / 2),
            (0.15, 0.17, 0.3),
            CLOTHING,
        )
        for sign in (1, -1)
    ]
    trunk = (0.6 * length, width, chin - hip)
    torso = Part("box", trunk, (0.0, 0.0, (hip + chin) / 2), colour, CLOTHING)
    middle = (0.0, 0.0, (chin + height) / 2)
    head = Part("sphere", (height - chin,) * 3, middle, (0.9, 0.72, 0.6), SKIN)
    return BodyKind(name, "pedestrian", size, (*legs, torso, head))


def _cyclist(name: str, size: Triple) -> BodyKind:
    length, width, height = size
    radius = 0.34
    wheels = [
        _box((x - radius, x + radius), (-0.03, 0.03), (0.0, 2 * radius), BLACK, RUBBER)
        for x in (length / 2 - radius, radius - length / 2)
    ]
    place = (-0.25, 0.2), (-width / 2, width / 2), (2 * radius, height)
    rider = _box(*place, (0.1, 0.5, 0.3), CLOTHING)
    return BodyKind(name, "bicycle", size, (*wheels, rider))


def _parked_bicycle(name: str, size: Triple) -> BodyKind:
    """Two wheels, a frame of tubes, saddle and handlebar, and nobody on it."""
    length, width, height = size
    radius = 0.34
    wheels = [
        _box((x - radius, x + radius), (-0.02, 0.02), (0.0, 2 * radius), BLACK, RUBBER)
        for x in (length / 2 - radius, radius - length / 2)
    ]
    frame = _box((-0.35, 0.4), (-0.025, 0.025), (0.3, 0.8), (0.1, 0.3, 0.5))
    saddle = _box((-0.4, -0.15), (-0.08, 0.08), (0.85, 0.95), BLACK, RUBBER)
    handlebar = _box((0.35, 0.5), (-width / 2, width / 2), (height - 0.08, height), BLACK)
    return BodyKind(name, "bicycle", size, (*wheels, frame, saddle, handlebar))


def _motorcycle(name: str, size: Triple) -> BodyKind:
    """Two wheels, tank and engine between them, and a rider."""
    length, width, height = size
    radius = 0.31
    wheels = [
        _box((x - radius, x + radius), (-0.07, 0.07), (0.0, 2 * radius), BLACK, RUBBER)
        for x in (length / 2 - radius, radius - length / 2)
    ]
    engine = _box((-0.75, 0.6), (-0.2, 0.2), (0.3, 0.85), (0.6, 0.1, 0.1))
    place = (-0.45, 0.15), (-width / 2, width / 2), (0.75, height)
    rider = _box(*place, (0.15, 0.15, 0.18), CLOTHING)
    return BodyKind(name, "bicycle", size, (*wheels, engine, rider))


CATALOGUE = {
    kind.name: kind
    for kind in (
        _two_box("car", "car", (4.61, 1.95, 1.72), 0.95, (0.18, 0.72), (0.15, 0.3, 0.65)),
        # A panel van, reported as a truck: length and width of a Volkswagen Transporter with long
        # wheelbase, and a raised roof.
        _two_box(
            "van", "truck", (5.30, 1.90, 2.40), 2.00, (0.0, 0.85), (0.85, 0.85, 0.88), LIGHT_PAINT
        ),
        _lorry("truck", "truck", (6.74, 2.46, 2.73), 1.7, 2.3, (0.75, 0.2, 0.15)),
        _block("bus", "bus", (11.19, 2.94, 3.47), (0.9, 0.75, 0.1), LIGHT_PAINT),
        _cyclist("bicycle", (1.68, 0.60, 1.27)),
        # A city bicycle in a rack: the room that FGSV plans one with is 2 m by 0.6 m.
        _parked_bicycle("parked bicycle", (1.80, 0.60, 1.08)),
        # Its mean size in nuScenes as in the anchors of CBGS (Zhu et al. 2019, Det3D). Reported as
        # a bicycle, the one class of two-wheelers; the recordings leave motorcycles out.
        _motorcycle("motorcycle", (2.11, 0.77, 1.47)),
        _person("pedestrian", (0.73, 0.66, 1.76), (0.85, 0.15, 0.2)),
        # The targets of Euro NCAP's tests: adult, seven-year-old child and car as in the public
        # OpenSCENARIO files of the protocols (vectorgrp/OSC-NCAP-scenarios), the bicycle as there
        # with a rider up to 1.86 m (ACEA, bicyclist target).
        _person("adult", (0.60, 0.50, 1.80), (0.2, 0.25, 0.5)),
        _person("child", (0.711, 0.298, 1.154), (0.9, 0.5, 0.1)),
        _cyclist("bicyclist", (1.89, 0.50, 1.86)),
        _two_box("target car", "car", (4.023, 1.712, 1.427), 0.85, (0.1, 0.72), (0.6, 0.6, 0.65)),
        # Bodies that the five reported classes do not hold. A box trailer on its legs, side skirts
        # down: length and height of nuScenes, the width that European roads allow (Directive
        # 96/53/EC: 2.55 m).
        _block("trailer", None, (12.01, 2.55, 3.82), (0.55, 0.57, 0.6), LIGHT_PAINT),
        # Site hoarding of 2.4 m panels.
        _block("hoarding", None, (12.0, 0.10, 2.40), (0.2, 0.4, 0.3), TIMBER),
        # A piece of garden hedge as high as a person: below the 2 m that German neighbour law
        # allows near a boundary.
        _block("hedge", None, (6.0, 0.8, 1.8), (0.2, 0.42, 0.2), LEAVES),
        # A garden wall of two metres, the highest beside a pavement that most German building codes
        # allow without a permit.
        _block("wall", None, (6.0, 0.24, 2.0), (0.6, 0.5, 0.42), CONCRETE),
        # A skip for rubble, 7 cubic metres (DIN 30720).
        _block("skip", None, (3.6, 1.75, 1.5), (0.8, 0.5, 0.1)),
        # A detached house of two storeys.
        _block("house", None, (11.0, 9.0, 6.5), (0.72, 0.6, 0.5), CONCRETE),
        _block("building", None, (18.0, 8.0, 9.0), (0.66, 0.6, 0.54), CONCRETE),
        # A closed row of eight such buildings.
        _block("terrace", None, (144.0, 8.0, 9.0), (0.66, 0.6, 0.54), CONCRETE),
        # The recording car of nuScenes, a Renault Zoe: 4.08 x 1.73 x 1.56 (manufacturer's data
        # sheet).
        BodyKind(
            "ego",
            None,
            (4.08, 1.73, 1.56),
            (
                _box((-2.04, 2.04), (-0.865, 0.865), (0.0, 0.85), (0.9, 0.9, 0.92)),
                _box((-1.7, 0.25), (-0.765, 0.765), (0.85, 1.56), TINTED, GLASS),
            ),
        ),
    )
}


def sized(name: str, label: str | None, size: Triple) -> BodyKind:
    """Return a body of any size. The parts of the catalogue's kind for `label` are scaled to it;
    without a label the body is a block. Round parts stay round and within the box.
    """
    if label is None:
        return _block(name, None, size, (0.5, 0.5, 0.5))
    kind = CATALOGUE[label]
    x, y, z = (new / old for new, old in zip(size, kind.size, strict=True))
    # A round part has one factor across its axis, the smaller of the two, and so stays within.
    turn = min(x, y)
    scales = {"box": (x, y, z), "cylinder": (turn, turn, z), "sphere": (min(turn, z),) * 3}
    parts = tuple(
        replace(
            part,
            size=_scaled(part.size, scales[part.shape]),
            centre=_scaled(part.centre, (x, y, z)),
        )
        for part in kind.parts
    )
    return BodyKind(name, label, size, parts)


def _scaled(triple: Triple, scale: Triple) -> Triple:
    x, y, z = (float(value * factor) for value, factor in zip(triple, scale, strict=True))
    return x, y, z
