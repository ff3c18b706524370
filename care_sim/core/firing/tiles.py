"""Tiles: rectangles of cells, as emitters that are lit zone by zone have them."""

from care_sim.core.firing.blocks import Blocks


class Tiles(Blocks):
    """A flash sensor without moving parts, whose emitters are switched in sub-arrays."""

    name = "tiles"
    numbers = ("ROWS", "COLUMNS")
    usual = (4, 8)
    unit = "tile"
    product = "solid-state flash sensor with addressable sub-arrays of emitters"
    source = (
        "TriLumina, Progress in High-Power High-Speed VCSEL Arrays, 2016, doi 10.1117/12.2215009: "
        "sub-array regions are addressed separately"
    )
