"""Shots: hardware may fire a cell more than once, and it then stands as often among what fired."""

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.grid import Cells


def shots_by_cell(fired: Cells, size: int) -> tuple[Cells, Integers | None]:
    """The cells (n,) of what `fired`, ascending, each once, and (size,) how often each cell of a
    grid of that size fires; None where none fires more than once, as with all but one hardware.
    """
    again = fired[1:] == fired[:-1]
    # Asked at every keyframe of every hardware: a count of all cells would take much longer.
    if not again.any():
        return fired, None
    shots = np.bincount(fired, minlength=size)
    return np.flatnonzero(shots), shots
