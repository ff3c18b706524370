"""A beam that spreads, as a bundle of rays: one in the middle and six round it."""

from dataclasses import replace

import numpy as np

from care_sim.core.cells.stack import Grid
from care_sim.core.grid import AngularGrid

_RING = np.sqrt(7 / 12)
"""How far from the middle the six lie, in half beams. So the seven rays, of equal weight, have the
variance of a disc that is lit evenly: 1/4 of the half beam squared along each axis."""
_CUT_APART = 1e-9
"""Radians between rows that are cut: rows of a grid descend."""


def bundle(grid: Grid, divergence_mrad: float) -> list[Grid]:
    """Grids whose cells hold one ray of each cell's beam; the grid itself, then those of the ring.

    `divergence_mrad` is the angle between opposite edges of the beam in milliradians. At rows that
    look up or down by e, beams are narrower across by cos(e).
    """
    if not isinstance(grid, AngularGrid):
        each = [_bundle(one, divergence_mrad) for one in grid.grids]
        return [replace(grid, grids=rays) for rays in zip(*each, strict=True)]
    return [*_bundle(grid, divergence_mrad)]


def _bundle(grid: AngularGrid, divergence_mrad: float) -> list[AngularGrid]:
    """The same of one LiDAR."""
    radius = _RING * divergence_mrad / 2000
    angles = np.arange(6) * np.pi / 3
    around = zip(
        (radius * np.cos(angles)).tolist(), (radius * np.sin(angles)).tolist(), strict=True
    )
    return [grid, *(_shifted(grid, across, up) for across, up in around)]


def _shifted(grid: AngularGrid, across: float, up: float) -> AngularGrid:
    """The grid turned to the left by `across` about its own axes, its rows raised by `up`,
    radians.
    """
    from scipy.spatial.transform import Rotation

    raised = _raised(grid, up)
    turned = grid.heading + across
    if not grid.is_tilted:
        return replace(raised, heading=float(np.remainder(turned + np.pi, 2 * np.pi) - np.pi))
    # A tilt is told about the heading: the same tilt is another one about another heading.
    mount = grid.tilt * Rotation.from_euler("Z", turned)
    heading, lowered, roll = mount.as_euler("ZYX").tolist()
    return replace(raised, heading=heading, pitch=-lowered, roll=roll)


def _raised(grid: AngularGrid, up: float) -> AngularGrid:
    """The grid with its rows raised by `up` radians; straight up is as far up as a row goes, and
    straight down as far down.
    """
    rows = grid.elevations + up
    apart = _CUT_APART * np.arange(grid.rows)
    held = np.clip(rows, apart[::-1] - np.pi / 2, np.pi / 2 - apart)
    # Where rows are cut the others keep their places, so that not all are evenly spaced.
    listed = tuple(held.tolist()) if grid.listed or (held != rows).any() else ()
    return replace(grid, top=float(held[0]), bottom=float(held[-1]), listed=listed)
