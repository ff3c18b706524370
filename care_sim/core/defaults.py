"""Names and defaults of conditions that need no simulator, so that options which show them load in
no time.
"""

RESERVE_FRACTION = 0.3
"""rho, the share of the budget kept for the reserve (paper, Remark 2)."""
AZIMUTH_MARGIN = 2
"""Dilation of hulls and wedges, in columns (paper, Remark 2)."""
ELEVATION_MARGIN = 1
"""Dilation of hulls and wedges, in rows (paper, Remark 2)."""
CELLS = "cells"
"""Hardware that fires every cell by itself: the paper's, and the default."""

AS_DEMANDED = "as-demanded"
CELL_ORDERS = (
    AS_DEMANDED,
    "rows-down",
    "rows-up",
    "columns",
    "random",
    "spread",
    "core-spread",
)
"""How the cells of a set can be listed:

- `as-demanded`, as the policy lists them;
- `rows-down`, row by row from the top, `rows-up`, from the bottom, both by ascending column;
- `columns`, column by column from right to left, each from the top;
- `random`, by one permutation of the grid, the same at every keyframe and for every policy;
- `spread`, by a low-discrepancy sequence: any first few cells lie evenly over the set;
- `core-spread`, first the set without the margins by which sets are dilated, then these margins,
  both spread. A set narrower than the margins keeps its middle; on the first and last row of the
  grid there is none. A set that was dilated by less loses as much all the same.
"""
HEAVIEST = 1e6
"""Largest weight of a term of the reward: sums of floats do not lose the other terms."""
