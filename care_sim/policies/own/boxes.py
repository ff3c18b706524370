"""The simplest rule that uses a camera: a few cells of every image box, then one row ahead."""

import numpy as np

from care_sim.base.checks import check_whole
from care_sim.core.belief import Belief
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import entry_cells
from care_sim.policies.own.care import CORE_FIRST


class Boxes(Policy):
    """Fires a few cells of every camera box, then the row at which objects enter the range.

    Each box gets its first `cells` cells, the core first. The row follows, straight ahead first;
    the floor gets the rest. It has no residual and no tracks: a policy that does not beat it owes
    its score to the boxes. Raises InvalidInput unless `cells` is a whole number of 1 or more.
    """

    name = "boxes"
    source = "own: every camera box alike, and one row"
    keeps_order = True

    def __init__(self, rig: Rig, cells: int = 4):
        super().__init__(rig)
        check_whole("cells", cells, 1)
        self._few = cells
        row = entry_cells(rig)
        off_ahead = np.concatenate([np.abs(head.grid.azimuths) for head in rig.grid.heads])
        self._row = row[np.argsort(off_ahead, kind="stable")]

    def demand(self, belief: Belief) -> Demand:
        """Return the layers: the boxes, then the row."""
        boxes = self.rig.listed(wedges(belief.detections, self.rig), CORE_FIRST, self._few)
        return Demand(layers=[boxes, [self._row]])
