"""What returns tell besides their ranges, cell by cell, for `info`."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.grid import Cells

Told = dict[str, Floats]
"""By name, (n,) numbers of the fired cells, 0 of a cell without a return."""


def told_by(fired: Cells, cells: Cells, **columns: Floats | None) -> Told:
    """The `columns` (k,) of returns of ascending `cells` (k,) as numbers of the `fired` ones,
    ascending too; of several returns of a cell the first. A column that is None tells nothing.
    """
    told = {}
    for name, values in columns.items():
        if values is not None:
            told[name] = np.zeros(len(fired))
            # From behind, so that the first of a cell is written last.
            told[name][np.searchsorted(fired, cells[::-1])] = values[::-1]
    return told
