"""CARE whose sets give their best cells first, and whose first round serves every set."""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

from care_sim.base.checks import check_whole
from care_sim.core.cells.sets import WorldSets
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.observation.beliefs import Beliefs
from care_sim.core.residual import unexplained_layer_of
from care_sim.core.rig import Rig
from care_sim.policies.base import RowPolicy

CORE_FIRST = "core-spread"
"""The order of the cells in hulls and wedges (`care_sim.core.cells.order`), unless the rig has one:
the rim is there for errors of the forecast, without which the object lies in the core alone."""
HULL_CELLS_PER_RETURN = 2
"""Cells that a hull gets in a round for every return that a detection needs."""
WEDGE_CELLS_PER_RETURN = 3
"""Cells that a wedge gets in a round for every return that a detection needs. Both numbers were
chosen on the calibration's streets 1000 to 1007 and on streets 2000 to 2007, none of which is
scored."""


class Round(NamedTuple):
    """The cells that each hull and each wedge gets in a round."""

    hull: int
    wedge: int

    @classmethod
    def of(cls, min_returns: int) -> "Round":
        """That of a detector which needs so many returns. Raises InvalidInput unless they are a
        whole number of at least 1.
        """
        check_whole("min_returns", min_returns, 1)
        return cls(HULL_CELLS_PER_RETURN * min_returns, WEDGE_CELLS_PER_RETURN * min_returns)


class CareSpread(RowPolicy):
    """The reserve of CARE, spent otherwise. It asks no more of a set than a detection needs, before
    another set has had as much.

    First every unexplained wedge gets a few cells, then every hull; then both get as many again.
    What is left goes to the floor. Sets are listed with their undilated core first, spread evenly
    (`core-spread`), unless the rig has an order. All of it is in the reserve layers, in order of
    priority: the share rho plays no part. `min_returns` is what the proxy needs to detect an
    object; with another detector it is the default.
    """

    name = "care-spread"
    source = "own: the reserve of CARE, core first, in rounds"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(self, rig: Rig, min_returns: int = MIN_RETURNS):
        super().__init__(rig)
        self._round = Round.of(min_returns)

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Layers: a round of wedges, a round of hulls, and both again."""
        unexplained = unexplained_layer_of(beliefs)
        few, more = self._round
        wedges = self._listed(unexplained, 2 * more)
        hulls = self._listed(beliefs.hulls, 2 * few)
        return [
            WorldSets.nothing(len(beliefs)),
            wedges.part(0, more),
            hulls.part(0, few),
            wedges.part(more, 2 * more),
            hulls.part(few, 2 * few),
        ]

    def _listed(self, given: WorldSets, most: int) -> WorldSets:
        """The first `most` cells of every set, the core first."""
        return WorldSets(self.rig.listed(given.sets, CORE_FIRST, most), given.counts)
