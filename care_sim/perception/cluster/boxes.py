"""Boxes from the sides that points show: fit a rectangle to their corner, then the class whose size
fits the rectangle.

The typical size of a class gives the expected length of each shown side. A side that the scan does
not resolve is only a lower bound; the far sides follow from the typical size.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.types import CLASSES
from care_sim.perception.cluster.points import COLUMNS_APART, NEAR_RADIUS_M, cluster_radius
from care_sim.world.bodies import CATALOGUE

STEP_DEG = 1.0
"""Step between headings tried: 4 cm over half a car's length."""
ON_THE_SIDE_M = 0.02
"""Smallest distance of a point to a side that counts: the noise of a range."""

DECIMALS = 6
"""Decimals of a candidate's score. Candidates that agree in them are equal on every processor, and
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
        """Return (2,) the sensor's distance from the rectangle along each axis; 0 within its
        extent.
        """
        return np.maximum(np.maximum(self.low, -self.high), 0.0)

    @property
    def range_m(self) -> float:
        """From the sensor to the middle."""
        return float(np.hypot(*self.middle))


def fit_sides(plan: Floats) -> Sides:
    """Fit the rectangle of points (n, 2), n >= 1, x, y in the sensor frame. The method is L-shape
    fitting by search with the closeness criterion. Source: Zhang, Xu, Dong, Dolan, "Efficient
    L-shape fitting for vehicle detection using laser scanners", IEEE Intelligent Vehicles Symposium
    2017, Algorithms 2 and 4.

    Headings are tried from the bearing of the points on, so the fit turns with them.
    """
    bearing = np.arctan2(*plan.mean(axis=0)[::-1])
    headings = bearing + np.deg2rad(np.arange(0.0, 90.0, STEP_DEG))
    cos, sin = np.cos(headings), np.sin(headings)
    axes = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], axis=1)
    along = axes @ plan.T

    # Rounded, so that the first of headings that differ only in the last bits is taken.
    best = axes[np.argmax(np.round(_closeness(along), DECIMALS))]
    return Sides(best, (best @ plan.T).min(axis=1), (best @ plan.T).max(axis=1))


def _closeness(along: Floats) -> Floats:
    """Return (h,) the sum over points of 1 / distance to the nearer of the two shown sides; `along`
    is (h, 2, n).
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


SIZE_SPREAD = 0.1
"""Standard deviation of sizes within a class, as a share: passenger cars are 3.7 to 5.5 m long,
adults 1.5 to 2 m.
"""
FIT_M = 0.1
"""Standard deviation of a fitted side in addition to the grid's resolution: rounded corners,
mirrors, a swung arm.
"""
MOST_MISFIT = 11.3
"""Largest misfit of a class: 99 of 100 bodies of the class stay below it (chi-squared, three
dimensions).
"""

_TYPICAL = ("car", "van", "truck", "bus", "bicycle", "pedestrian")
"""The bodies whose sizes represent the classes. A child or a test's target is recognised as far as
it resembles one of them.
"""
_CLASSED = [CATALOGUE[name] for name in _TYPICAL]
_CLASSES: Integers = np.array([CLASSES.index(kind.label or "") for kind in _CLASSED] * 2)
_SIZES: Floats = np.array([kind.size for kind in _CLASSED])
"""Length, width, height."""
_ALONG: Floats = np.concatenate([_SIZES, _SIZES[:, [1, 0, 2]]])
"""(2k, 3) extents along both axes of the sides and up, of bodies heading along the first axis, then
the second.
"""


@dataclass(frozen=True)
class Guess:
    """The best class for some sides: `label` into CLASSES, `box` (7,) in the sensor frame,
    `misfit`, chi-squared.
    """

    label: int
    box: Floats
    misfit: float


def best_guess(
    sides: Sides, top_m: float, road_z: float, sensor_height_m: float, grid: Grid
) -> Guess:
    """Return the best class and box for `sides` whose highest point is `top_m` above the road at
    `road_z`.
    """
    seen = np.append(
        sides.spans + _hidden_ends(sides, grid), top_m + grid.row_height * sides.range_m / 2
    )
    misfits = np.round(_misfits(sides, seen, sensor_height_m, grid), DECIMALS)
    best = int(np.argmin(misfits))
    return Guess(int(_CLASSES[best]), _completed(sides, seen, best, road_z), float(misfits[best]))


def _hidden_ends(sides: Sides, grid: Grid) -> Floats:
    """Return (2,) the hidden length per side: half a column, on average, beyond the last point at
    either end.
    """
    return np.asarray(grid.column_width * np.abs(sides.middle[::-1]))


def _misfits(sides: Sides, seen: Floats, sensor_height_m: float, grid: Grid) -> Floats:
    """Return (2k,) the sum of squared deviations of `seen` (3,) from each typical size, in standard
    deviations.

    A side should not look longer than the body, nor shorter than its connected part.
    """
    # Either end of a side lies anywhere within half a step of its last point: a variance of
    # step^2 / 12 each, and step^2 / 6 for both. Only the upper end of a height is uncertain, so its
    # step is divided by sqrt(2).
    range_m = sides.range_m
    steps = np.array([grid.column_width, grid.column_width, grid.row_height / np.sqrt(2)]) * range_m

    # A side that the scan shows in several pieces may look as short as a piece minus the gap
    # between clusters. The same holds for a top above the highest row.
    shown = np.minimum(
        _ALONG, np.append(_hanging(sides, grid), sensor_height_m + range_m * np.tan(grid.top))
    )
    blurred = np.where(shown < _ALONG, cluster_radius(grid, range_m), 0.0)
    variance = (SIZE_SPREAD * _ALONG) ** 2 + FIT_M**2 + steps**2 / 6 + blurred**2

    # Between the piece and the whole, any length fits. One of the two terms is 0.
    deviation = np.maximum(seen - _ALONG, 0.0) + np.minimum(seen - shown, 0.0)
    return np.asarray((deviation**2 / variance).sum(axis=1))


def _hanging(sides: Sides, grid: Grid) -> Floats:
    """Return (2,) the length of the side along each axis that may be seen in one piece, metres.

    At range r, points of a side at distance d from the sensor are r^2 / d columns apart. They are
    connected where this is within the cluster radius.
    """
    off = sides.outside[::-1]
    farthest = np.maximum(np.sqrt(NEAR_RADIUS_M * off / grid.column_width), COLUMNS_APART * off)
    return np.asarray(
        np.maximum(np.sqrt(np.maximum(farthest**2 - off**2, 0.0)) - sides.outside, 0.0)
    )


def _completed(sides: Sides, seen: Floats, which: int, road_z: float) -> Floats:
    """Return (7,) the box on the shown sides. It extends from the nearest end away from the sensor,
    or about the middle where the sensor is level with the side. The heading is ambiguous by half a
    turn; it points away from the sensor.
    """
    # A body is at least as large as it looks; its hidden part has the size of its class.
    extents = np.maximum(seen, _ALONG[which])
    half = extents[:2] / 2
    along = np.where(
        sides.low > 0, sides.low + half, np.where(sides.high < 0, sides.high - half, sides.middle)
    )
    centre = along @ sides.axes
    forward = which // len(_CLASSED)
    # Rounded, so that a body straight abeam points the same way on every processor.
    heading = sides.axes[forward] * (
        1.0 if np.round(sides.middle[forward], DECIMALS) >= 0 else -1.0
    )
    length_width = extents[[forward, 1 - forward]]
    yaw = np.arctan2(heading[1], heading[0])
    return np.array([*centre, road_z + extents[2] / 2, *length_width, extents[2], yaw])
