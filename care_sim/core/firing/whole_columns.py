"""Whole columns: upright planes of light, which a mirror turns to any azimuth."""

from care_sim.base.errors import InvalidInput
from care_sim.core.firing.blocks import Blocks
from care_sim.core.grid_stack import Grid


class WholeColumns(Blocks):
    """A line laser whose upright plane a galvanometer mirror turns. How fast the mirror turns is
    not held to here; `azimuth-window` is hardware that turns slowly. Of several LiDARs each has its
    own. Raises InvalidInput where their columns have different numbers of cells.
    """

    name = "columns"
    unit = "column"
    product = "line laser on a galvanometer mirror (light curtain)"
    source = "Wang et al., Programmable Triangulation Light Curtains, ECCV 2018"

    def __init__(self, grid: Grid):
        rows = sorted({head.grid.rows for head in grid.heads})
        if len(rows) > 1:
            raise InvalidInput(
                f"firing columns needs LiDARs of as many rows each, got {rows[0]} and {rows[-1]}"
            )
        super().__init__(grid, rows[0], 1)
