"""The types of arrays, by what they hold."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]
ONE_WORLD: Mask = np.ones(1, np.bool_)
"""(1,) the mask of a single world, which plays."""


def places(mask: Mask) -> list[int]:
    """The places at which a mask is True, ascending."""
    found: list[int] = np.flatnonzero(mask).tolist()
    return found


def filled(table: np.ndarray, world: int, rows: np.ndarray) -> np.ndarray:
    """The table (W, n, ...) with `rows` (k, ...) at the beginning of a world's; a longer table, if
    they need more room than there is.
    """
    if len(rows) > table.shape[1]:
        # A quarter more than is needed: a large vector has a table of meshes per world.
        table = longer(table, len(rows) * 5 // 4)
    table[world, : len(rows)] = rows
    return table


def longer(table: np.ndarray, length: int, empty: int = 0) -> np.ndarray:
    """The table (W, n, ...) with `length` rows per world; new rows hold `empty`."""
    grown = np.full((len(table), length, *table.shape[2:]), empty, table.dtype)
    grown[:, : table.shape[1]] = table
    return grown
