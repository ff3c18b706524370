"""Whole rows: scan lines all the way across, as an oscillating mirror draws them."""

from care_sim.core.firing.blocks import Blocks
from care_sim.core.grid_stack import Grid


class WholeRows(Blocks):
    """A sensor with two mirrors: the fast one draws a whole line, the slow one chooses which."""

    name = "rows"
    unit = "row"
    product = "scanner with micro-mirrors that draws whole scan lines"
    source = (
        "Blickfeld, Qb2 documentation, Scan Pattern: a scan line per half swing of the horizontal "
        "mirror; their number and foveation"
    )

    def __init__(self, grid: Grid):
        super().__init__(grid, 1, grid.columns)
