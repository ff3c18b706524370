"""The sides of a body that its points show: the rectangle that fits their corner.

L-shape fitting by search, closeness criterion: Zhang, Xu, Dong, Dolan, "Efficient L-shape fitting
for vehicle detection using laser scanners", IEEE Intelligent Vehicles Symposium 2017, Algorithms 2
and 4.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats

STEP_DEG = 1.0
"""Between two headings tried: over half a car's length it is 4 cm."""
ON_THE_SIDE_M = 0.02
"""Nearer to a side no point counts more: the noise of a range."""

DECIMALS = 6
"""Candidates whose scores agree in so many are equal, whatever the last bits of a processor, and
the first is taken.
"""


@dataclass(frozen=True)
class Sides:
    """A rectangle in plan: `axes` (2, 2) unit vectors in rows, `low` and `high` (2,) its bounds
    along them, metres from the sensor.
    """

    axes: Floats
    low: Floats
    high: Floats

    @property
    def spans(self) -> Floats:
        """(2,) extents along the axes."""
        return self.high - self.low

    @property
    def middle(self) -> Floats:
        """(2,) along the axes."""
        return (self.low + self.high) / 2

    @property
    def outside(self) -> Floats:
        """(2,) how far the sensor is off the rectangle along each axis; 0 where it is level with
        it.
        """
        return np.maximum(np.maximum(self.low, -self.high), 0.0)

    @property
    def range_m(self) -> float:
        """From the sensor to the middle."""
        return float(np.hypot(*self.middle))


def fit_sides(plan: Floats) -> Sides:
    """The rectangle of points (n, 2), n >= 1, x, y in the sensor frame.

    Headings are tried from the bearing of the points on, so the fit turns with them.
    """
    bearing = np.arctan2(*plan.mean(axis=0)[::-1])
    headings = bearing + np.deg2rad(np.arange(0.0, 90.0, STEP_DEG))
    cos, sin = np.cos(headings), np.sin(headings)
    axes = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    along = axes @ plan.T

    # Rounded, so that of headings equal but for the last bits the first is taken.
    best = axes[np.argmax(np.round(_closeness(along), DECIMALS))]
    return Sides(best, (best @ plan.T).min(axis=1), (best @ plan.T).max(axis=1))


def _closeness(along: Floats) -> Floats:
    """(h,) the sum over the points of 1 / distance to the nearer of the two shown sides; `along` is
    (h, 2, n).
    """
    to_low = along - along.min(axis=2, keepdims=True)
    to_high = along.max(axis=2, keepdims=True) - along
    to_lows, to_highs = (
        np.round(np.linalg.norm(one, axis=2), DECIMALS) for one in (to_low, to_high)
    )

    # Along each axis the shown side is the one that the points lie nearer to, all together. A point
    # counts by its distance to the nearer of the two shown sides: it lies on one of them.
    low_is_shown = to_lows <= to_highs
    distance = np.where(low_is_shown[..., None], to_low, to_high).min(axis=1)
    return np.asarray((1.0 / np.maximum(distance, ON_THE_SIDE_M)).sum(axis=1))
