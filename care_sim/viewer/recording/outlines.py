"""Sets of cells as outlines over the picture of the grid."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.frames import Floats
from care_sim.core.grid import AngularGrid, Cells
from care_sim.viewer.recording.entities import ROW_PIXELS


def outlines(sectors: Sequence[Cells], grid: AngularGrid) -> Floats:
    """(n, 4: left, top, right, bottom in pixels) of angular rectangles of cells; two of one that
    lies across the seam behind the car, none of one without cells.
    """
    boxes = [box for cells in sectors if len(cells) for box in _boxes(cells, grid)]
    return np.array(boxes, float).reshape(-1, 4)


def _boxes(cells: Cells, grid: AngularGrid) -> list[tuple[float, ...]]:
    top, bottom = int(cells[0]) // grid.columns, int(cells[-1]) // grid.columns + 1
    columns = cells[: np.searchsorted(cells, (top + 1) * grid.columns)] % grid.columns
    runs = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    return [
        (grid.columns - 1 - run[-1], top * ROW_PIXELS, grid.columns - run[0], bottom * ROW_PIXELS)
        for run in runs
    ]
