"""Class confusion: objects that are found, and reported as another class."""

import numpy as np

from care_sim.core.arrays import Floats, Integers


def confused(classes: Integers, draws: Floats, matrix: Floats) -> Integers:
    """(n,) the classes that are reported of objects of `classes` (n,).

    `matrix` (c, c) holds the chances that the class of a row is reported as that of a column;
    `draws` (n,) from 0 to 1 decide.
    """
    # The reported class is the first whose chance, with those before it, is beyond the draw. The
    # last sum is 1 but for its last bits.
    sums = np.cumsum(matrix, axis=1)[classes]
    reported: Integers = np.minimum((draws[:, None] >= sums).sum(axis=1), matrix.shape[1] - 1)
    return reported
