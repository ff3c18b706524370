"""CARE whose sets give their best cells first, and whose first round serves every set."""

from collections.abc import Sequence

from care_sim.base.checks import check_known, check_whole
from care_sim.core.belief import Belief
from care_sim.core.cell_order import CELL_ORDERS
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.grid import Cells
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy

HULL_CELLS_PER_RETURN = 2
"""Cells of a hull for every return that a detection needs: about half the rays through the middle
of a forecast meet the object."""
WEDGE_CELLS_PER_RETURN = 3
"""Cells of a wedge for every return that a detection needs: fewer meet the object, since an image
box is no body and holds its surroundings, too."""


class CareSpread(Policy):
    """The reserve of CARE, spent otherwise. It asks no more of a set than a detection needs, before
    another set has had as much.

    First every unexplained wedge gets a few cells, then every hull; then the wedges get as many
    again, then the hulls. What is left goes to the floor. Sets are listed in a `cell_order` of
    `care_sim.core.cell_order.CELL_ORDERS`: by default their undilated core first, spread evenly,
    since the rim is there for errors of the forecast and holds nothing without them. All of it is
    in the reserve layers, in order of priority: the share rho plays no part. `min_returns` is what
    the detector needs.
    """

    name = "care-spread"
    source = "own: the reserve of CARE, core first, in rounds"

    def __init__(self, rig: Rig, min_returns: int = MIN_RETURNS, cell_order: str = "core-spread"):
        super().__init__(rig)
        check_whole("min_returns", min_returns, 1)
        check_known("cell_order", cell_order, CELL_ORDERS)
        self._order = cell_order
        self._wedge_round = WEDGE_CELLS_PER_RETURN * min_returns
        self._hull_round = HULL_CELLS_PER_RETURN * min_returns

    def demand(self, belief: Belief) -> Demand:
        """Layers: a round of wedges, a round of hulls, and both again."""
        unexplained, _ = camera_layers(belief, self.rig)
        wedges = self.rig.reordered(unexplained, self._order)
        hulls = self.rig.reordered(self.rig.hulls(belief.tracks.boxes), self._order)
        return Demand(
            layers=[
                part(wedges, 0, self._wedge_round),
                part(hulls, 0, self._hull_round),
                part(wedges, self._wedge_round, 2 * self._wedge_round),
                part(hulls, self._hull_round, self._hull_round + self._wedge_round),
            ]
        )


def part(sets: Sequence[Cells], first: int, last: int) -> list[Cells]:
    """From every set its cells from place `first` up to, not including, `last`."""
    return [cells[first:last] for cells in sets]
