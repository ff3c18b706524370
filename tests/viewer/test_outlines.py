import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.viewer.recording.entities import ROW_PIXELS
from care_sim.viewer.recording.picture_log import outlines
from tests.helpers.lidars import STACK

GRID = AngularGrid(columns=8, rows=4)


def test_a_sector_of_two_lidars_has_an_outline_in_each():
    """Rows 6 and 7 are the last of the first, and row 8 is the first of the second."""
    cells = np.array([6 * 64 + 3, 7 * 64 + 3, 8 * 64 + 40])
    assert sorted(outlines([cells], STACK).tolist()) == [
        [23, 8 * ROW_PIXELS, 24, 9 * ROW_PIXELS],
        [60, 6 * ROW_PIXELS, 61, 8 * ROW_PIXELS],
    ]


@pytest.mark.parametrize(
    ("rows", "columns", "boxes"),
    [
        ((1, 2), (5, 6), [[1, 1, 3, 3]]),
        ((0,), (7, 8, 9), [[0, 0, 1, 1], [6, 0, 8, 1]]),
        ((3,), range(8), [[0, 3, 8, 4]]),
        ((), (), []),
    ],
)
def test_an_outline_is_mirrored_and_has_two_parts_across_the_seam(rows, columns, boxes):
    cells = np.sort([row * 8 + column % 8 for row in rows for column in columns]).astype(int)
    found = outlines([cells], GRID) / [1, ROW_PIXELS, 1, ROW_PIXELS]
    assert sorted(found.tolist()) == boxes
