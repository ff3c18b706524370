"""How much of a LiDAR's light fog and rain take away, per metre of way."""

import math

KOSCHMIEDER = 3.912
"""ln 50: at the meteorological visibility 2% of the contrast is left (Koschmieder 1924). Fog of a
visibility below 500 m dims all light alike, near infrared too (Kim, McArthur and Korevaar 2001);
beyond that near infrared is dimmed less, which is left out."""
RAIN_DB_PER_KM, RAIN_POWER = 1.076, 0.67
"""1.076 R^0.67 dB/km at R mm/h (Carbonneau and Wisely 1998; ITU-R P.1814)."""
DB_PER_FACTOR_E = 10 / math.log(10)
"""Decibels of a factor e of power, 4.343."""


def fog_extinction(visibility_m: float) -> float:
    """Extinction of fog per metre: 3.912 / V; 0 in clear air, which is written as 0 m."""
    return KOSCHMIEDER / visibility_m if visibility_m else 0.0


def rain_extinction(rain_mm_h: float) -> float:
    """Extinction of rain per metre, 0 without rain."""
    decibels_per_km: float = RAIN_DB_PER_KM * rain_mm_h**RAIN_POWER
    return decibels_per_km / DB_PER_FACTOR_E / 1000
