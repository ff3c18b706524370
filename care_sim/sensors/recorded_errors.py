"""Lost returns and range errors of recorded sweeps.

The figures come from two sweeps of real LiDARs: one of an HDL-32E (nuScenes) and one of two VLP-32C
(Argoverse 2). Shares of lost returns are per row, for rows that look at the road, where each range
is known. Both sweeps lose 2% where the road is within 12 m, 6% at 18 m, and 11 to 13% from 21 to 38
m. Errors are those of consecutive returns about the smooth line through them. They are 0.5 cm on
the road up to 11 m, 0.8 cm at 17 m and on walls at 25 m. Farther surfaces are not smooth enough to
separate errors. The script `docs/examples/sweeps/real_sweeps.py` prints the figures.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import NO_OBJECT, Cloud, joined
from care_sim.sensors.lidar import noisy

LOST_NEAR, LOST_FAR = 0.02, 0.13
"""Shares of returns that are lost up to the first and from the second of LOST_RANGES_M on; between
them they grow evenly."""
LOST_RANGES_M = 12.0, 25.0
KEPT_RANGES_M = 5.0, 15.0, 25.0, 40.0
KEPT = {
    "car": (0.59, 0.53, 0.38, 0.28),
    "truck": (0.62, 0.62, 0.58, 0.52),
    "bus": (0.50, 0.50, 0.50, 0.50),
    "bicycle": (0.40, 0.40, 0.32, 0.32),
    "pedestrian": (0.59, 0.54, 0.60, 0.65),
}
"""The share of the returns of our bodies that an object of nuScenes has: glass, dark paint, and a
shape that does not fill its box. The shares divide the returns that nuScenes counted in 3,279 boxes
(81 keyframes) by our own. Our rays were cast at bodies in the same boxes, on as many columns.
Trucks within 10 m and buses beyond 20 m are too few, and have the nearest figure."""
KEPT_SPREAD = 0.25
"""By which an object departs from that share, evenly up or down: of cars within 20 m nine in ten
lie within 0.25 of the middle."""
FEWEST_KEPT = 0.05
PASSED = {"car": 0.65, "truck": 0.39, "bus": 0.39, "bicycle": 0.87, "pedestrian": 0.87}
"""Share of an object's unreturned rays that return from behind it: past a corner of its box,
between legs, through a window. The rest returns nothing. Measured on the upper VLP-32C of Argoverse
2, for rays through labelled boxes within 50 m. 15 cars return 58% from the box and 27% from behind
it, five people 38 and 54%, a bus 90 and 4%. The script `docs/examples/sweeps/real_sweeps.py` prints
the figures. A truck has the figure of the bus, a bicycle that of people (choice).
"""
_PASSED = np.array([PASSED[name] for name in CLASSES])
OWN_CAR_SHARES = 0.82, 0.47, 0.26, 0.12, 0.0
OWN_CAR_DEG = -30.7, -25.3, -24.0, -22.7, -21.3
"""Shares of the rays at these elevations that end on the car itself: rows of the HDL-32E of
nuScenes, 1.84 m above the road. In the lowest row four of five rays do."""
SIGMA_M, SIGMA_PER_M = 0.004, 0.00016
"""Standard deviation of a range at the sensor, and by how much it grows per metre."""

SLOPE = 0.020, 0.015
"""Standard deviations of how the road about the car slopes against the sensor, along and across:
crossfall (2.5% at least, RASt 06), changes of gradient, springs and the mount. Fitted planes slope
by 2.7% (nuScenes), 2.6% (Argoverse 2) and 1.1 to 3.0% (11 sweeps of RADIATE)."""
MOST_SIGMAS = 2.0
SLOPE_CHANGES_M = 60.0
"""Half of the variance changes along the way, with this wavelength (choice): the slope that RADIATE
shows in 6 s of driving changes by 1.5%."""


def slopes(ego: Floats, rng: np.random.Generator) -> Floats:
    """(k, 2) pitch and roll, radians, of the sensor over the road at the poses `ego` (k, 3)."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ego[:, :2], axis=0).T))])
    steady = rng.standard_normal(2) * np.sqrt(0.5)
    phases = rng.uniform(-np.pi, np.pi, 2)
    changing = np.sin(2 * np.pi * along[:, None] / SLOPE_CHANGES_M + phases)
    tilt: Floats = np.clip(steady + changing, -MOST_SIGMAS, MOST_SIGMAS) * SLOPE
    return tilt


def add_recorded_losses(
    cloud: Cloud,
    grid: Grid,
    objects: tuple[Integers, Floats],
    behind: Callable[[Cells], Cloud],
    rng: np.random.Generator,
) -> Cloud:
    """The cloud with the losses and errors of a recorded sweep. All are drawn for every cell,
    whatever it returns.

    `objects` are the classes (n,) of all bodies by number, below 0 without one, and how well each
    returns (n,), from -1 to 1 and 0 on average. `behind` tells what cells (k,), ascending, return
    that pass by all of these.
    """
    luck, passing, own = rng.random((3, grid.size))
    errors = rng.standard_normal(grid.size)
    cloud = cloud.take(own[cloud.cells] >= _hidden_by_own_car(cloud, grid))

    kept = luck[cloud.cells] < _kept_shares(cloud, grid, objects)
    (missed,) = np.nonzero(~kept & (cloud.objects != NO_OBJECT))
    classes, _ = objects
    passed = passing[cloud.cells[missed]] < _PASSED[classes[cloud.objects[missed]]]
    cloud = joined([cloud.take(kept), behind(cloud.cells[missed[passed]])])

    ranges, away = _rays(cloud, grid)
    erring = errors[cloud.cells] * (SIGMA_M + SIGMA_PER_M * ranges)
    measured = noisy(ranges, erring, grid.reach_of(cloud.cells))
    points: Floats = cloud.points + away * (measured / ranges - 1)[:, None]
    return replace(cloud, points=points)


def _hidden_by_own_car(cloud: Cloud, grid: Grid) -> Floats:
    """(P,) the chance that a ray has ended on the car itself."""
    ranges, away = _rays(cloud, grid)
    elevations = np.degrees(np.arcsin(away[:, 2] / ranges))
    return np.interp(elevations, OWN_CAR_DEG, OWN_CAR_SHARES)


def _kept_shares(cloud: Cloud, grid: Grid, objects: tuple[Integers, Floats]) -> Floats:
    """(P,) the chance of each return to be there in a recorded sweep."""
    ranges, _ = _rays(cloud, grid)
    kept = 1 - np.interp(ranges, LOST_RANGES_M, (LOST_NEAR, LOST_FAR))
    classes, bright = objects
    (on,) = np.nonzero(cloud.objects != NO_OBJECT)
    own_class, own_bright = classes[cloud.objects[on]], bright[cloud.objects[on]]
    shares = np.array([np.interp(ranges[on], KEPT_RANGES_M, KEPT[name]) for name in CLASSES])
    own_share = shares[own_class, np.arange(len(on))] + KEPT_SPREAD * own_bright
    kept[on] = np.clip(own_share, FEWEST_KEPT, 1.0)
    return kept


def _rays(cloud: Cloud, grid: Grid) -> tuple[Floats, Floats]:
    """Ranges (P,) and the ways (P, 3) from the LiDAR to the points."""
    away: Floats = cloud.points - grid.origins_of(cloud.cells)
    return np.linalg.norm(away, axis=1), away
