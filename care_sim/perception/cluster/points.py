"""Separate road points, and group the others."""

import numpy as np

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.stack import Grid

STEEPEST = 0.03
"""Largest slope of the road against the car's own plane: 1 degree of pitch, as under hard braking,
and the bend of a road over 50 m.
"""
SETTLING_M = 0.15
"""Largest offset of the road from the sensor's nominal height: springs, and a climbed kerb."""
ROUGHNESS_M = 0.05
"""Noise of ranges and unevenness. Points much farther off the plane have hardly any weight."""
KERB_CLEARANCE_M = 0.25
"""Height above the plane from which a point is an object: a kerb (0.15 m) and twice the
roughness.
"""


def heights_above(points: Floats, plane: Floats) -> Floats:
    """(P,) metres of points (P, 3) above the road `plane` (3,)."""
    return np.asarray(points[:, 2] - points[:, :2] @ plane[:2] - plane[2])


def road_plane(points: Floats, sensor_height_m: float) -> Floats:
    """Return (3,) a, b, c of the road z = a x + b y + c in the sensor frame.

    The fit is least squares with Cauchy's loss over points that could lie on the road. Slope and
    offset are bounded, so few or misleading points do little harm. Without points the plane is
    level. The fit turns with the points.
    """
    level = np.array([0.0, 0.0, -sensor_height_m])
    low = points[_could_be_road(points, level)]
    if len(low) < len(level):
        return level

    # The free numbers are those of the bounded departure, so the fit needs no bounds of its own.
    design = np.column_stack([low[:, :2], np.ones(len(low))])

    def misses(free: Floats) -> Floats:
        return np.asarray(design @ (level + _bounded(free)[0]) - low[:, 2])

    def jacobian(free: Floats) -> Floats:

        return np.asarray(design @ _bounded(free)[1])

    from scipy.optimize import least_squares

    fit = least_squares(misses, np.zeros(3), jacobian, loss="cauchy", f_scale=ROUGHNESS_M)
    return level + _bounded(fit.x)[0]


def _bounded(free: Floats) -> tuple[Floats, Floats]:
    """Return (3,) a departure from the level plane from three free numbers, and its derivatives (3,
    3). The slope stays below STEEPEST in every direction, the offset below SETTLING_M.
    """
    departure = np.empty(3)
    derivatives = np.zeros((3, 3))
    # u / sqrt(1 + |u|^2) maps all vectors into the unit disc, alike in every direction.
    for part, most in ((slice(2), STEEPEST), (slice(2, 3), SETTLING_M)):
        u = free[part]
        scale = np.sqrt(1 + u @ u)
        departure[part] = most * u / scale
        derivatives[part, part] = most * (np.eye(len(u)) / scale - np.outer(u, u) / scale**3)
    return departure, derivatives


def _could_be_road(points: Floats, level: Floats) -> Mask:
    # The largest distance of the road from the level plane at this range, plus its roughness.
    reach = SETTLING_M + ROUGHNESS_M + STEEPEST * np.hypot(points[:, 0], points[:, 1])
    return np.asarray(np.abs(heights_above(points, level)) <= reach)


NEAR_RADIUS_M = 0.3
"""Two people a metre apart, each 0.66 m wide, leave 0.34 m between them: the radius must stay
below.
"""
COLUMNS_APART = 2.0
"""Largest distance of far neighbours in columns: one cell may be unfired or without return, or the
surface seen at 60 degrees.
"""


def cluster_radius(grid: Grid, range_m: float) -> float:
    """The distance, metres, up to which two points at `range_m` belong together."""
    return max(NEAR_RADIUS_M, COLUMNS_APART * grid.column_width * range_m)


def clusters_of(plan: Floats, grid: Grid) -> list[Integers]:
    """Return the clusters of points (P, 2), x, y in the sensor frame, as indices; every point is in
    one.

    Points nearer than `cluster_radius` belong together, directly or through others. This is DBSCAN
    with a minimum of one point (Ester, Kriegel, Sander, Xu, KDD 1996). Every point is then a core
    point, no border point is ambiguous, and the order of the points does not matter. Clusters come
    in the order of their first points.

    Clustering is in plan, since road users stand beside each other and not on top. Only gaps
    between columns, 0.012 rad apart, then need bridging, not those between rows, 0.023 rad apart (1
    m at 45 m).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(plan):
        return []
    points = _even(plan, grid)
    # The tree finds pairs up to and including its radius; neighbours must be nearer than 1.
    pairs = cKDTree(points).query_pairs(np.nextafter(1.0, 0.0), output_type="ndarray")

    # Clusters are the connected parts of the graph of neighbours. A stable sort by label keeps
    # their points in order, and labels follow the order of first points.
    near = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(points), len(points)))
    _, labels = connected_components(near, directed=False)
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def _even(plan: Floats, grid: Grid) -> Floats:
    """Map points to (P, 3) where `cluster_radius` is 1 everywhere.

    The map is a disc as far as the radius is constant. Beyond, where the radius is a share of the
    range, the disc continues as a tube around its rim, along the logarithm of the range. Lengths r
    dphi and dr are then divided alike.
    """
    # At the rim both rules for the radius give the same. Within it `beyond` is 1 and its logarithm
    # 0: a flat disc in units of the constant radius.
    share = COLUMNS_APART * grid.column_width
    rim = NEAR_RADIUS_M / share
    ranges = np.hypot(plan[:, 0], plan[:, 1])
    beyond = np.maximum(ranges / rim, 1.0)
    return np.column_stack([plan / beyond[:, None] / NEAR_RADIUS_M, np.log(beyond) / share])
