"""Rounds: no set is given more cells than a detection needs before every other has had as much."""

from typing import NamedTuple

from care_sim.base.checks import check_whole

CORE_FIRST = "core-spread"
"""The order of the cells in hulls and wedges (`care_sim.core.cell_order`), unless the rig has one:
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
