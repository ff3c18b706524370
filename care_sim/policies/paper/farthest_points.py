"""Farthest point sampling of the full scan: saves no sensing."""

import numpy as np

from care_sim.base.extras import import_open3d
from care_sim.core.arrays import Floats
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.loops.truth import Truth
from care_sim.policies.paper.matched_fraction import MatchedFraction


class FarthestPoints(MatchedFraction):
    """The second reference of the paper (Sec. 5.1): a matched fraction by farthest point sampling.

    The sampling (PointNet++, Qi et al., NeurIPS 2017; Open3D) begins with the first point of the
    full cloud.

    Raises MissingExtra without Open3D.
    """

    name = "farthest-points"
    source = "CARE paper, Sec. 5.1, after Qi et al., PointNet++, NeurIPS 2017; Open3D"

    def __init__(self, rig: Rig, truth: Truth):
        super().__init__(rig, truth)
        # A missing extra is told before the episode, not at its first keyframe.
        import_open3d()

    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """The `count` cells whose points lie farthest from each other."""
        from scipy.spatial import cKDTree

        if count == 0:
            return cells[:0]
        open3d = import_open3d()
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        # The sample holds points, not their places. Each is its own nearest one.
        _, places = cKDTree(points).query(
            np.asarray(cloud.farthest_point_down_sample(count).points)
        )
        return cells[places]
