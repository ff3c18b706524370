"""The types of arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]


def filled(table: np.ndarray, world: int, rows: np.ndarray) -> np.ndarray:
    """The table (W, n, ...) with `rows` (k, ...) at the beginning of a world's; a longer table, if
    they need more room than there is.
    """
    if len(rows) > table.shape[1]:
        longer = np.zeros((len(table), 2 * len(rows), *table.shape[2:]), table.dtype)
        longer[:, : table.shape[1]] = table
        table = longer
    table[world, : len(rows)] = rows
    return table
