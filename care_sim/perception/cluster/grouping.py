"""Groups of points that belong together: DBSCAN in plan, with a radius that grows with the range.

In plan, because road users stand beside each other and not on top: the rows of the scan, 0.023 rad
apart (1 m at 45 m), then need no bridging, only the columns, 0.012 rad apart, do.
"""

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.stack import Grid

NEAR_RADIUS_M = 0.3
"""Two people a metre apart, each 0.66 m wide, leave 0.34 m between them: the radius must stay
below.
"""
COLUMNS_APART = 2.0
"""Far away, neighbours are this many columns apart at most: one cell may be unfired or without
return, or the surface be seen at 60 degrees."""


def cluster_radius(grid: Grid, range_m: float) -> float:
    """The distance, metres, up to which two points at `range_m` belong together."""
    return max(NEAR_RADIUS_M, COLUMNS_APART * grid.column_width * range_m)


def clusters_of(plan: Floats, grid: Grid) -> list[Integers]:
    """The clusters of points (P, 2) x, y in the sensor frame, as indices; every point is in one.

    Two points nearer than `cluster_radius` belong together, and so do those that others connect.
    This is DBSCAN with one point as the least (Ester, Kriegel, Sander, Xu, KDD 1996): every point
    is a core point, so no border point can fall to either of two clusters, and the order of the
    points does not matter. Clusters come in the order of their first points.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(plan):
        return []
    points = _even(plan, grid)
    # The tree finds pairs up to its radius; neighbours are nearer than 1, and not at it.
    pairs = cKDTree(points).query_pairs(np.nextafter(1.0, 0.0), output_type="ndarray")

    # Clusters are the parts of the graph of neighbours that hang together. A stable sort by label
    # keeps their points in order, and labels are given in the order of first points.
    near = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(points), len(points)))
    _, labels = connected_components(near, directed=False)
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def _even(plan: Floats, grid: Grid) -> Floats:
    """(P, 3) where `cluster_radius` is 1 everywhere.

    A disc as far as the radius is constant; beyond, where it is a share of the range, the disc goes
    on as a tube around its rim, with the logarithm of the range along it: lengths r dphi and dr are
    divided alike.
    """
    # At the rim both rules for the radius give the same. Within it `beyond` is 1 and its logarithm
    # 0: a flat disc in units of the constant radius.
    share = COLUMNS_APART * grid.column_width
    rim = NEAR_RADIUS_M / share
    ranges = np.hypot(plan[:, 0], plan[:, 1])
    beyond = np.maximum(ranges / rim, 1.0)
    return np.column_stack([plan / beyond[:, None] / NEAR_RADIUS_M, np.log(beyond) / share])
