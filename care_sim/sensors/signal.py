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

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.return_settings import ReturnSettings
from care_sim.sensors.weather import fog_extinction, rain_extinction


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
