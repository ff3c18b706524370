"""What returns tell besides their ranges, cell by cell, for `info`."""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.grid import Cells

_NO_CELL = -1
"""Stands for none."""
Told = dict[str, Floats]
"""By name, (n,) numbers of the fired cells, 0 of a cell without a return."""


def told_by(fired: Cells, cells: Cells, **columns: Floats | None) -> Told:
    """The `columns` (k,) of returns of ascending `cells` (k,) as numbers of the `fired` ones,
    ascending too: of several returns of a cell the first, of a cell fired several times the same
    for each. A column that is None tells nothing.
    """
    known = {name: values for name, values in columns.items() if values is not None}
    if not known:
        return {}
    # The place of the first return of every fired cell; behind the last one there is none.
    first = np.searchsorted(cells, fired)
    returned = np.append(cells, _NO_CELL)[first] == fired
    return {
        name: np.where(returned, np.append(values, 0.0)[first], 0.0)
        for name, values in known.items()
    }
