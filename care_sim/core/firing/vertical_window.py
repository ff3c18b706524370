"""A vertical window: neighbouring rows, steered up and down."""

from functools import cached_property

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.firing.window import Window
from care_sim.core.grid_stack import Grid


class VerticalWindow(Window):
    """A sensor with a vertical field of view that is set anew for every frame, anywhere on the
    grid. Before the first keyframe it stands on the horizon.
    """

    name = "vertical-window"
    unit = "row"
    product = "long-range scanner with an adjustable vertical field of view"
    source = (
        "Luminar, Iris product sheet: vertical field of view dynamically adjustable (not opened)"
    )

    def __init__(self, grid: Grid):
        super().__init__(grid, grid.columns)

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the row of every cell."""
        return np.arange(self.grid.size) // self.grid.columns

    def _places(self, stood: int, width: int) -> Integers:
        # A window of rows has an upper and a lower end: no place goes around.
        places = np.arange(self.units - width + 1)
        return places[np.argsort(np.abs(places - stood), kind="stable")]

    def _start(self, width: int) -> int:
        horizon = int(np.argmin(np.abs(self.lidar.elevations_ahead)))
        return min(max(horizon - width // 2, 0), self.units - width)
