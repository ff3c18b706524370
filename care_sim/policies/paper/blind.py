"""The paper's baselines without camera and tracks: the full scan, random cells, fewer beams, and
full scans that are thinned afterwards and save no sensing.
"""

from abc import abstractmethod
from zlib import crc32

import numpy as np

from care_sim.base.checks import check_seed
from care_sim.base.digests import portable_bytes
from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_open3d
from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief
from care_sim.core.cells.stack import Grid
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.loops.truth import Truth
from care_sim.policies.base import FixedPolicy, PrivilegedPolicy


class MatchedFraction(PrivilegedPolicy):
    """A reference that is not causal (paper, Sec. 5.1).

    It chooses from the full cloud of P points, keeps round(beta P) of them, and so saves no
    sensing. The rest of the budget goes to cells without returns, in ascending order, so that the
    shared floor adds no point.
    """

    tags = ("non-causal",)

    @abstractmethod
    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """Return `count` of the `cells` (P,), which return `points` (P, 3) in the sensor frame."""

    def demand(self, belief: Belief) -> Demand:
        """Return the kept points, then silent cells."""
        scan = self.truth.full_scan()
        returned = np.isfinite(scan.ranges)
        cells = scan.cells[returned]
        points = self.rig.grid.points(cells, scan.ranges[returned])
        # The fraction beta is the budget over all cells: the belief holds the budget in cells.
        kept = self.kept(cells, points, round(belief.budget * len(cells) / self.rig.grid.size))
        silent = scan.cells[~returned][: belief.budget - len(kept)]
        return Demand(layers=[[np.sort(kept)], [silent]])


class Full(FixedPolicy):
    """Fires every cell. Belongs in an environment made with `budget=1.0` and refuses another."""

    name = "full"
    source = "CARE paper, Sec. 5.2 (full-scan bound)"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        if rig.budget != rig.grid.size:
            raise InvalidInput(
                f"policy full needs budget=1.0, this environment fires {rig.budget} of "
                f"{rig.grid.size} cells"
            )

    def fixed(self, budget: int) -> Demand:
        """Return all cells as one reserve layer: exploitation alone would stop at (1 - rho) B."""
        return Demand(layers=[[np.arange(self.rig.grid.size)]])


class Random(FixedPolicy):
    """Demands nothing, so that the shared random floor spends the whole budget."""

    name = "random"
    source = "CARE paper, Sec. 4.1, Algorithm 1 (the floor alone)"

    def fixed(self, budget: int) -> Demand:
        """Return an empty demand."""
        return Demand()


class BeamReduce(FixedPolicy):
    """Beam reduction of LiDAR Distillation (Wei et al., ECCV 2022), as a causal scan policy.

    The original drops scan lines from a cloud. The paper (Sec. 5.1) adapts it: whole rows are
    fired, the nearest to the horizon first. The last row is thinned evenly, so that the demand has
    exactly B cells.
    """

    name = "beam-reduce"
    source = "CARE paper, Sec. 5.1, after Wei et al., LiDAR Distillation, ECCV 2022"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        self._rows = horizon_rows(rig.grid, rig.budget)

    def fixed(self, budget: int) -> Demand:
        """Return one layer per row, without exploitation."""
        return Demand(layers=[[cells] for cells in self._rows])


def horizon_rows(grid: Grid, count: int) -> list[Cells]:
    """Return `count` cells of the rows nearest to the horizon, nearest first.

    The last row is evenly thinned.
    """
    # The height of a row's unit ray straight ahead orders rows by elevation. Rows equally far above
    # and below the horizon keep the order of their index: the upper one first.
    rises = [
        head.grid.directions[int(np.argmin(head.grid.from_ahead)) :: grid.columns, 2]
        for head in grid.heads
    ]
    nearest = np.argsort(np.abs(np.concatenate(rises)), kind="stable")
    whole, rest = divmod(count, grid.columns)
    # Whole rows, then the rest in one more, if there is any.
    widths = [grid.columns] * whole + [rest] * (rest > 0)
    return [
        row * grid.columns + np.arange(width) * grid.columns // width
        for row, width in zip(nearest.tolist(), widths, strict=False)
    ]


class RandomPoints(MatchedFraction):
    """The first reference of the paper (Sec. 5.1): a matched fraction, drawn at random.

    `seed` and the cloud decide the draw, so that no two keyframes or episodes share one. The last
    bits of the cloud, which differ between processors, are ignored.
    """

    name = "random-points"
    source = "CARE paper, Sec. 5.1 (random point sampling)"

    def __init__(self, rig: Rig, truth: Truth, seed: int = 0):
        super().__init__(rig, truth)
        check_seed(seed)
        self._seed = seed

    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """Return `count` cells at random."""
        rng = np.random.default_rng((self._seed, crc32(portable_bytes(cells, points))))
        return rng.choice(cells, count, replace=False)


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
        # A missing extra is reported before the episode, not at its first keyframe.
        import_open3d()

    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """Return the `count` cells whose points lie farthest from each other."""
        from scipy.spatial import cKDTree

        if count == 0:
            return cells[:0]
        open3d = import_open3d()
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        # The sample holds points, not their places. The nearest cloud point of each is itself.
        _, places = cKDTree(points).query(
            np.asarray(cloud.farthest_point_down_sample(count).points)
        )
        return cells[places]
