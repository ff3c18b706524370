"""Rows of tables in compiled code."""

import numpy as np

from care_sim.base.compiled import compiled


@compiled(brief=True)
def copy_row(row: np.ndarray, into: np.ndarray) -> None:
    """Copy a row (n,) to the first n places of `into`."""
    # An assignment of slices is slower, and Numba compiles the text of its error for seconds.
    for k in range(len(row)):
        into[k] = row[k]
