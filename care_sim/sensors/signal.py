"""How strong a return is, and whether it is strong enough: the equation of a LiDAR whose beam falls
whole on a surface that scatters alike in all directions.

The received power is proportional to rho cos(theta) exp(-2 alpha r) / r^2 with the reflectance rho,
the angle of incidence theta, the extinction alpha of the air and the range r (Wagner et al. 2006,
ISPRS Journal 60; with rain, Goodin et al. 2019, Electronics 8, 89). What factor lies before it is
the sensor's secret. Its data sheet tells the same in other words: the range R at which a target of
reflectance rho_0 that faces it is still seen. Therefore a return exists where

    rho cos(theta) exp(-2 alpha r) / r^2 >= rho_0 / R^2.

Of a cell that is fired n times the receiver adds up what it counts. Limited by its own photons, of
which it must count so many, it needs an nth of the power: the left side counts n times, and in
clear air the reach grows with the square root of n. `docs/firing.md` has the sources.
"""

import math

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import ReturnSettings


class Signal:
    """The signal of a sensor under settings that state its range."""

    def __init__(self, settings: ReturnSettings):
        self._extinction = fog_extinction(settings.visibility_m) + rain_extinction(
            settings.rain_mm_h
        )
        stated = settings.lidar_stated_range_m
        self._least = settings.lidar_stated_reflectance / stated**2 if stated else 0.0

    def intensities(self, brightness: Floats, ranges: Floats) -> Floats:
        """(n,) what returns from surfaces of a `brightness` (n,), reflectance times cosine of the
        incidence, at `ranges` (n,), as if all were at one range: 0 to 1, 0 for an infinite range.

        So sensors tell it that calibrate their intensities. The air between is not taken out.
        """
        # Without air between, exp(-0 * inf) would be no number.
        met = np.isfinite(ranges)
        air = np.exp(-2 * self._extinction * np.where(met, ranges, 0.0))
        return np.where(met, brightness * air, 0.0)

    def suffices(self, intensities: Floats, ranges: Floats, shots: Integers | int = 1) -> Mask:
        """(n,) whether returns of `intensities` (n,) from `ranges` (n,) are noticed, of cells that
        are fired `shots` (n,) times.
        """
        met = np.isfinite(ranges)
        enough: Mask = shots * intensities >= self._least * np.where(met, ranges, 0.0) ** 2
        return met & enough

    def shots_needed(self, intensities: Floats, ranges: Floats) -> Floats:
        """(n,) the fewest shots with which returns of `intensities` (n,) from `ranges` (n,) are
        noticed, whole numbers from 1; inf where none suffice.
        """
        needed = np.full(len(ranges), np.inf)
        met = np.isfinite(ranges) & (intensities > 0)
        np.divide(self._least * ranges**2, intensities, out=needed, where=met)
        fewest: Floats = np.maximum(np.ceil(needed), 1.0)
        return fewest


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
