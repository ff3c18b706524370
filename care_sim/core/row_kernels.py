"""Copy rows of arrays in compiled code."""

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats


@compiled(brief=True)
def copy_rows(rows: Floats, into: Floats) -> None:
    """Copy `rows` (n, k) to the first n rows of `into` (m, k).

    An assignment of slices does the same, but Numba compiles the text of its error along, which
    takes seconds.
    """
    for n in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            into[n, k] = rows[n, k]
