import numpy as np

from care_sim.core.grid import AngularGrid
from care_sim.viewer.recording.entities import ROW_PIXELS
from care_sim.viewer.recording.picture_log import outlines
from tests.helpers.lidars import STACK

GRID = AngularGrid(columns=8, rows=4)


def rectangle(rows, columns):
    return np.sort([row * 8 + column % 8 for row in rows for column in columns])


def test_an_outline_is_mirrored_so_that_left_is_left():
    (box,) = outlines([rectangle((1, 2), (5, 6))], GRID).tolist()
    assert box == [1, ROW_PIXELS, 3, 3 * ROW_PIXELS]


def test_a_sector_across_the_seam_has_two_outlines():
    boxes = outlines([rectangle((0,), (7, 8, 9))], GRID).tolist()
    assert sorted(boxes) == [[0, 0, 1, ROW_PIXELS], [6, 0, 8, ROW_PIXELS]]


def test_all_around_is_one_outline_and_nothing_is_none():
    assert outlines([rectangle((3,), range(8)), np.array([], np.int64)], GRID).tolist() == [
        [0, 3 * ROW_PIXELS, 8, 4 * ROW_PIXELS]
    ]
    assert outlines([], GRID).shape == (0, 4)


def test_a_sector_of_two_lidars_has_an_outline_in_each():
    """Rows 6 and 7 are the last of the first, and row 8 is the first of the second."""
    cells = np.array([6 * 64 + 3, 7 * 64 + 3, 8 * 64 + 40])
    assert sorted(outlines([cells], STACK).tolist()) == [
        [23, 8 * ROW_PIXELS, 24, 9 * ROW_PIXELS],
        [60, 6 * ROW_PIXELS, 61, 8 * ROW_PIXELS],
    ]
