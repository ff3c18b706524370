"""Ring segments: pieces of one row, as a spinning sensor with masked channels has them."""

from care_sim.core.firing.blocks import Blocks
from care_sim.core.grid_stack import Grid


class RingSegments(Blocks):
    """A spinning sensor that is told for every channel in which sections of azimuth it fires. The
    sensor of the source knows five sections per channel, which is not held to here.
    """

    name = "segments"
    numbers = ("COLUMNS",)
    usual = (16,)
    unit = "segment"
    product = "spinning sensor with sections of azimuth for every channel"
    source = (
        "Hesai, PandarQT user manual Q01-en-2101A1, Sec. 4.3, Azimuth FOV (Sec. 4.3.3, "
        "multi-section FOV, not opened)"
    )

    def __init__(self, grid: Grid, columns: int):
        super().__init__(grid, 1, columns)
