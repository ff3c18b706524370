"""Groups of points that belong together: DBSCAN in plan, with a radius that grows with the range.

In plan, because road users stand beside each other and not on top: the rows of the scan, 0.023 rad
apart (1 m at 45 m), then need no bridging, only the columns, 0.012 rad apart, do.
"""

import numpy as np

from care_sim.base.extras import import_open3d
from care_sim.core.frames import Floats
from care_sim.core.grid import AngularGrid, Cells

NEAR_RADIUS_M = 0.3
"""Two people a metre apart, each 0.66 m wide, leave 0.34 m between them: the radius must stay
below.
"""
COLUMNS_APART = 2.0
"""Far away, neighbours are this many columns apart at most: one cell may be unfired or without
return, or the surface be seen at 60 degrees."""


def cluster_radius(grid: AngularGrid, range_m: float) -> float:
    """The distance, metres, up to which two points at `range_m` belong together."""
    return max(NEAR_RADIUS_M, COLUMNS_APART * grid.column_width * range_m)


def clusters_of(plan: Floats, grid: AngularGrid) -> list[Cells]:
    """The clusters of points (P, 2) x, y in the sensor frame, as indices; every point is in one.

    Connected parts at `cluster_radius`: DBSCAN with one point as the least, so that no border point
    can fall to either of two clusters and the order of the points does not matter. Needs Open3D.
    Raises MissingExtra.
    """
    open3d = import_open3d()
    if not len(plan):
        return []
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(_even(plan, grid)))
    labels = np.asarray(cloud.cluster_dbscan(eps=1.0, min_points=1), np.int64)
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)


def _even(plan: Floats, grid: AngularGrid) -> Floats:
    """(P, 3) where `cluster_radius` is 1 everywhere.

    A disc as far as the radius is constant; beyond, where it is a share of the range, the disc goes
    on as a tube around its rim, with the logarithm of the range along it: lengths r dphi and dr are
    divided alike.
    """
    share = COLUMNS_APART * grid.column_width
    rim = NEAR_RADIUS_M / share
    ranges = np.hypot(plan[:, 0], plan[:, 1])
    beyond = np.maximum(ranges / rim, 1.0)
    return np.column_stack([plan / beyond[:, None] / NEAR_RADIUS_M, np.log(beyond) / share])
