"""What bodies are made of, and how much of a near-infrared pulse each material gives back.

The LiDARs of cars send at 850 to 905 nm. A reflectance is the share of the light that a surface
scatters, as if it did so alike in all directions (Lambert); what shines like a mirror, as paint and
glass also do, is left out.
"""

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
    # What a surface of glass reflects at right angles (Fresnel, index 1.5). It goes one way, so a
    # LiDAR gets this much at the most.
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
"""Reflectance by material, 0 to 1."""
