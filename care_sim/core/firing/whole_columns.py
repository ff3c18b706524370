"""Whole columns: upright planes of light, which a mirror turns to any azimuth."""

from care_sim.core.firing.blocks import Blocks
from care_sim.core.grid import AngularGrid


class WholeColumns(Blocks):
    """A line laser whose upright plane a galvanometer mirror turns. How fast the mirror turns is
    not held to here; `azimuth-window` is hardware that turns slowly.
    """

    name = "columns"
    unit = "column"
    product = "line laser on a galvanometer mirror (light curtain)"
    source = "Wang et al., Programmable Triangulation Light Curtains, ECCV 2018"

    def __init__(self, grid: AngularGrid):
        super().__init__(grid, grid.rows, 1)
