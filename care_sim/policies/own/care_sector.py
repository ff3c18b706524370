"""CARE in rounds, with one fixed sector ahead for what the camera has not told yet."""

from collections.abc import Mapping
from typing import ClassVar

from care_sim.core.belief import Belief
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import cells_by_row, entry_cells
from care_sim.policies.own.care_sightlines import WEDGE_ROUNDS
from care_sim.policies.own.care_spread import CORE_FIRST, Round
from care_sim.policies.own.sight_lines import columns_ahead


class CareSector(Policy):
    """`care-sightlines` without its memory of lines of sight: the simplest policy that was found as
    good on generated streets.

    In order of priority: a round of unexplained wedges; the sector ahead, in the row at which
    things enter the range; a round of hulls; a round of explained wedges; the rest of the
    unexplained ones; the rest of that row; more of the hulls; and the pattern `rows` in the place
    of the random floor.
    """

    name = "care-sector"
    source = "own: the reserve of CARE in rounds, a fixed sector ahead, rows"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(self, rig: Rig, min_returns: int = MIN_RETURNS):
        super().__init__(rig)
        self._round = Round.of(min_returns)
        self._rows = cells_by_row(rig)
        entries = entry_cells(rig)
        self._entries = len(entries)
        self._sector = entries[columns_ahead(rig.grid)]

    def demand(self, belief: Belief) -> Demand:
        """Layers in order of priority; see the class."""
        unexplained, known = camera_layers(belief, self.rig)
        few, more = self._round
        wedges = self.rig.listed(unexplained, CORE_FIRST, WEDGE_ROUNDS * more)
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes), CORE_FIRST, few + more)
        return Demand(
            layers=[
                wedges.part(0, more),
                [self._sector],
                hulls.part(0, few),
                self.rig.listed(known, CORE_FIRST, few),
                wedges.part(more, WEDGE_ROUNDS * more),
                [self._rows[: self._entries]],
                hulls.part(few, few + more),
                [self._rows[: belief.budget]],
            ]
        )
