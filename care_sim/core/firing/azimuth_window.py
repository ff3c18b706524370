"""An azimuth window: neighbouring columns, which turn by at most so many degrees per keyframe."""

from functools import cached_property

import numpy as np

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Integers
from care_sim.core.firing.window import Window
from care_sim.core.grid_stack import Grid

_LAST_BITS = 1e-9
"""What rounding may take from a number of columns."""


class AzimuthWindow(Window):
    """A spinning sensor that fires within a window of azimuth. The window turns by at most
    `degrees` from keyframe to keyframe, and stands straight ahead before the first one.

    The sensor of the source restarts for another window, so that it has 0 degrees during a drive,
    and its lasers go on firing outside: it saves data, not shots. The usual 10 stand for a head
    that turns by 100 degrees a second; no product is known to. Raises InvalidInput for degrees
    outside 0 to 180, and for a grid that does not go all round.
    """

    name = "azimuth-window"
    numbers = ("DEGREES",)
    usual = (10.0,)
    unit = "column"
    product = "spinning sensor with one window of azimuth"
    source = (
        "Ouster, firmware user manual, Azimuth Window: it masks what is sent, and the lasers go on "
        "firing"
    )

    def __init__(self, grid: Grid, degrees: float):
        check_number("degrees of firing azimuth-window", degrees, 0, 180)
        super().__init__(grid, grid.rows)
        if not self.lidar.goes_round:
            raise InvalidInput(
                "firing azimuth-window turns all round, and the grid has no more than "
                f"{np.rad2deg(self.lidar.field_of_view):g} degrees"
            )
        self.reach = int(np.deg2rad(degrees) / self.lidar.column_width + _LAST_BITS)
        """Columns by which it turns at most."""

    @cached_property
    def unit_of(self) -> Integers:
        """(N,) the column of every cell."""
        return np.arange(self.grid.size) % self.grid.columns

    def _places(self, stood: int, width: int) -> Integers:
        # Half a turn to either side holds every place once.
        turns = np.arange(-((self.units - 1) // 2), self.units // 2 + 1)
        turns = turns[np.argsort(np.abs(turns), kind="stable")]
        return (stood + turns[np.abs(turns) <= self.reach]) % self.units

    def _start(self, width: int) -> int:
        # Column 0 begins at the right end of the grid.
        ahead = round(-self.lidar.right / self.lidar.column_width)
        return (ahead - width // 2) % self.units
