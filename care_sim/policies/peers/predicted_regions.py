"""Dense rays in predicted regions, sparse ones elsewhere, after Shoouri et al., AAAI 2026."""

from care_sim.base.checks import check_number
from care_sim.core.allocation import half_up
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.paper.tracks import uniform_pattern

SPARSE = 0.2
"""Share of the budget for the whole grid. The paper gives none."""


class AfterShoouri(Policy):
    """Scan densely where past scans and the camera predict objects, and sparsely elsewhere.

    The paper (arXiv 2508.01562) distils past LiDAR and camera features into queries. A mask
    generator, trained with the detector, draws binary masks of regions of interest from them. It
    saves 65% of a scan, and does not report budgets under 35%.

    Differences here: regions follow from boxes, not from features. They are the hulls of the
    forecasts and the wedges of all camera boxes, explained or not. If the budget is too small,
    regions get a cell each in turn, their rows from the top. An even pattern gets the share
    `sparse` of the budget first. Raises InvalidInput for a share outside 0 to 1.
    """

    name = "after-shoouri"
    source = "after Shoouri et al., Adaptive LiDAR Scanning, AAAI 2026, arXiv 2508.01562"

    def __init__(self, rig: Rig, sparse: float = SPARSE):
        super().__init__(rig)
        check_number("sparse", sparse, 0, 1)
        self._sparse = sparse

    def demand(self, belief: Belief) -> Demand:
        """Return the layers: the even pattern, the regions, and a pattern of the whole budget."""
        grid, budget = self.rig.grid, belief.budget
        regions = CellSets.joined(
            [self.rig.hulls(belief.tracks.boxes), wedges(belief.detections, self.rig)]
        )
        return Demand(
            layers=[
                [uniform_pattern(grid, half_up(self._sparse * budget))],
                regions,
                [uniform_pattern(grid, budget)],
            ]
        )
