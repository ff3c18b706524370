"""The echoes of beams whose rays meet several surfaces, and those that a sensor reports.

Surfaces near to each other along the beam melt into one echo between them: the mixed pixels at the
edges of bodies. Those farther apart give echoes of their own (Velodyne's manuals of the VLP-16 and
HDL-32E describe the modes strongest, last, and both).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import LAST, STRONGEST

SEPARATION_M = 1.0
"""Surfaces are told apart from this distance on (Velodyne, VLP-16 manual, dual returns)."""
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
        return cls(
            np.concatenate([part.beams for part in parts]),
            np.concatenate([part.ranges for part in parts]),
            np.concatenate([part.intensities for part in parts]),
            np.concatenate([part.bodies for part in parts]),
        )

    def take(self, rows: Integers) -> "Echoes":
        """Some of the echoes, by index."""
        return Echoes(
            self.beams[rows], self.ranges[rows], self.intensities[rows], self.bodies[rows]
        )


def echoes_of(ranges: Floats, intensities: Floats, bodies: Integers) -> Echoes:
    """The echoes of n beams of k rays of equal weight. The rays met `bodies` (k, n) at `ranges`
    (k, n), inf where they met none; `intensities` (k, n) are those that a whole beam would have.
    """
    count, beams = ranges.shape
    order = np.argsort(ranges, axis=0, kind="stable")
    ranges = np.take_along_axis(ranges, order, axis=0)
    intensities = np.take_along_axis(intensities, order, axis=0)
    bodies = np.take_along_axis(bodies, order, axis=0)
    # From the near end of a beam on, a gap begins the next echo. What met nothing comes last.
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
    """What a sensor reports of the echoes that keeps `strongest`, `last` or `both`.

    Where the strongest is also the last, `both` has the second strongest beside it (Velodyne,
    VLP-16 manual, page 57).
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
