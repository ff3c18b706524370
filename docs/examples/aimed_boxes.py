"""A short rule, to hold a policy against: rows ahead, then the middles of tracks and boxes.

It aims as `care-aimed` does, but treats all camera boxes alike, so it has no residual, and it
remembers nothing. Its numbers of cells were set by hand before it played:

    cd docs/examples
    care-sim benchmark --policy aimed_boxes:AimedBoxes
"""

import care_sim
from care_sim.core.residual import wedges
from care_sim.policies.controls.patterns import cells_by_row, entry_cells
from care_sim.policies.own.care_aimed import FRONT_RAD, SECOND_M, aimed
from care_sim.policies.own.sight_lines import columns_ahead


class AimedBoxes(care_sim.Policy):
    """Fire at two rows ahead, and at the middle of every track and camera box."""

    keeps_order = True

    def __init__(self, rig):
        super().__init__(rig)
        ahead = columns_ahead(rig.grid, FRONT_RAD)
        self.far, self.near = entry_cells(rig)[ahead], entry_cells(rig, SECOND_M)[ahead]
        self.rows = cells_by_row(rig)

    def demand(self, belief):
        """Layers: few cells of everything first, then more."""
        hulls = aimed(self.rig.hulls(belief.tracks.boxes), self.rig)
        boxes = aimed(wedges(belief.detections, self.rig), self.rig)
        few = [[self.far], hulls.part(0, 3), boxes.part(0, 6), [self.near]]
        more = [hulls.part(3, 12), boxes.part(6, 24), [self.rows[: belief.budget]]]
        return care_sim.Demand(layers=few + more)
