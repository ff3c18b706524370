"""Strength of returns, and whether a sensor notices them.

The equation is that of a LiDAR whose beam falls whole on a surface that scatters alike in all
directions. The received power is proportional to rho cos(theta) exp(-2 alpha r) / r^2. Here rho is
the reflectance, theta the angle of incidence, alpha the extinction of the air and r the range.
Sources: Wagner et al. 2006, ISPRS Journal 60; with rain, Goodin et al. 2019, Electronics 8, 89. The
constant factor is not published. A data sheet gives the range R at which a target of reflectance
rho_0 that faces the sensor is still seen. Therefore a return exists where rho cos(theta) exp(-2
alpha r) / r^2 >= rho_0 / R^2.

An early data sheet of Ouster's OS1 (scribd.com, document 672435817) states 40 m at 10%, 120 m at
80% and a beam of 2.3 mrad.

A receiver adds up the photons of n shots at a cell (Ouster, US 2023/0243975 A1; AEye,
RRRWP_19_0812, for several shots at one point). A receiver that is limited by its own photons needs
a fixed count, so it needs an nth of the power. The left side therefore counts n times, and in clear
air the range grows with the square root of n. In sunlight the signal to noise grows with the root
of the shots (Vaisala, CL61 user guide M212475EN), so the range grows with the fourth root of n.
Pile-up (Gupta et al. 2019, Photon-Flooded Single-Photon 3D Cameras) is left out.

The error of a mean falls with the root of n, which is computed. Wu et al. 2025 (Sensors 25, 6184)
disagree: where the clock limits, the error can fall with n.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import LAST, STRONGEST, ReturnSettings
from care_sim.sensors.engines.solid_kernels import met_surfaces
from care_sim.world.bodies import ASPHALT, REFLECTANCES
from care_sim.world.body_tables import Primitives
from care_sim.world.bullet import NO_BODY


class Signal:
    """The signal of a sensor under settings that state its range."""

    def __init__(self, settings: ReturnSettings):
        self._extinction = fog_extinction(settings.visibility_m) + rain_extinction(
            settings.rain_mm_h
        )
        stated = settings.lidar_stated_range_m
        self._least = settings.lidar_stated_reflectance / stated**2 if stated else 0.0

    def intensities(self, brightness: Floats, ranges: Floats) -> Floats:
        """Return (n,) intensities, 0 to 1, as if all surfaces were at one range. `brightness` (n,)
        is reflectance times cosine of the incidence. An infinite range in `ranges` (n,) gives 0.
        Sensors with calibrated intensities report them so. The loss in the air stays in.
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


def brightness(
    parts: Primitives, origins: Floats, rays: Floats, ranges: Floats, bodies: Integers
) -> Floats:
    """Return (n,) reflectance times cosine of the angle of incidence (Lambert), 0 without a hit.
    Unit `rays` (n, 3) from `origins` (n, 3) or (3,) met `bodies` (n,) at `ranges` (n,), all in the
    world as it stands now.
    """
    # A body that was met and has no parts is the road: level, so that the slope of a ray is its
    # angle.
    solid = np.isin(bodies, parts.tables[-1])
    met = np.flatnonzero(solid)
    road = np.flatnonzero(~solid & (bodies != NO_BODY))
    bright = np.zeros(len(bodies))
    bright[road] = REFLECTANCES[ASPHALT] * np.maximum(-rays[road, 2], 0.0)

    places = np.broadcast_to(origins, rays.shape)[met] + rays[met] * ranges[met, None]
    hit = bodies[met]
    found, cosines = met_surfaces(places, rays[met], hit, parts.poses[hit], parts.tables)
    reflectances = np.array([REFLECTANCES[name] for name in parts.materials])
    bright[met] = reflectances[found] * cosines
    return bright


SEPARATION_M = 1.0
"""Least distance between surfaces with separate returns (Velodyne, VLP-16 manual, dual returns)."""
_EDGE_ON = 1e-12
"""The intensity of a surface that is met edge-on, so that its place still counts."""


class Echoes(NamedTuple):
    """A row for each echo, by beam and then by range: `beams` (m,) the place of its beam, `ranges`
    (m,) in metres, `intensities` (m,) as in `care_sim.sensors.signal`, `bodies` (m,) ids.
    """

    beams: Integers
    ranges: Floats
    intensities: Floats
    bodies: Integers

    @classmethod
    def none(cls) -> "Echoes":
        """No echo."""
        return cls(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0, np.int64))

    @classmethod
    def joined(cls, parts: Sequence["Echoes"]) -> "Echoes":
        """All echoes of some parts, one after the other."""
        return cls._make(map(np.concatenate, zip(*parts, strict=True)))

    def take(self, rows: Integers) -> "Echoes":
        """Some of the echoes, by index."""
        return Echoes._make(column[rows] for column in self)


def echoes_of(ranges: Floats, intensities: Floats, bodies: Integers) -> Echoes:
    """The echoes of n beams of k rays of equal weight. The rays met `bodies` (k, n) at `ranges`
    (k, n), inf where they met none; `intensities` (k, n) are those that a whole beam would have.
    """
    count, beams = ranges.shape
    order = np.argsort(ranges, axis=0, kind="stable")
    ranges = np.take_along_axis(ranges, order, axis=0)
    intensities = np.take_along_axis(intensities, order, axis=0)
    bodies = np.take_along_axis(bodies, order, axis=0)
    # From the near end of a beam on, a gap begins the next echo. Rays without a hit come last.
    met = np.isfinite(ranges)
    gaps = np.diff(np.where(met, ranges, 0.0), axis=0) > SEPARATION_M
    number = np.vstack([np.zeros((1, beams), np.int64), np.cumsum(gaps, axis=0)])
    key = (np.arange(beams) * count + number)[met]

    # A ray's power falls with the square of its range; an echo lies where its power does.
    powers = np.maximum(intensities[met], _EDGE_ON) / ranges[met] ** 2 / count
    power = np.bincount(key, powers, beams * count)
    middle = np.bincount(key, powers * ranges[met], beams * count)
    (found,) = np.nonzero(power)
    where = middle[found] / power[found]
    # The body behind its strongest ray; keys ascend as the echoes do.
    body = bodies[met][_last_rows(key, powers)]
    return Echoes(found // count, where, power[found] * where**2, body)


def reported(echoes: Echoes, kept: str) -> Echoes:
    """Return the echoes that a sensor reports: the `strongest`, the `last` or `both`. If the
    strongest is also the last, `both` adds the second strongest (Velodyne, VLP-16 manual, page 57).
    """
    power = echoes.intensities / echoes.ranges**2
    if kept == STRONGEST:
        return echoes.take(_last_rows(echoes.beams, power))
    last = _last_rows(echoes.beams, echoes.ranges)
    if kept == LAST:
        return echoes.take(last)
    # The strongest but for the last one: the strongest of all, unless that is the last.
    others = np.setdiff1d(np.arange(len(power)), last)
    strongest = others[_last_rows(echoes.beams[others], power[others])]
    return echoes.take(np.union1d(strongest, last))


def _last_rows(groups: Integers, values: Floats) -> Integers:
    """The row of the largest value of each group, groups ascending."""
    order = np.lexsort((values, groups))
    _, sizes = np.unique(groups, return_counts=True)
    rows: Integers = order[np.cumsum(sizes) - 1]
    return rows
