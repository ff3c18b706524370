"""The boxes of what a picture of body ids shows, compiled.

A table of boxes is (n, 6): the id of a body; left, top, right and bottom of the box that holds all
its pixels; their number.
"""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers
from care_sim.world.bullet import NO_BODY, PixelWindow


@compiled()
def visible_boxes(ids: Integers) -> Integers:
    """The table of the boxes in a picture of ids (height, width), in ascending order."""
    # One row per possible id: ids are small, and a table is faster than a search.
    rows, columns = ids.shape
    highest = NO_BODY
    for row in range(rows):
        for column in range(columns):
            highest = max(highest, ids[row, column])
    found = np.zeros((highest + 1, 6), np.int64)

    # Stretch by stretch of equal ids, of which there are far fewer than pixels.
    for row in range(rows):
        column = 0
        while column < columns:
            body, first = ids[row, column], column
            while column < columns and ids[row, column] == body:
                column += 1
            if body != NO_BODY:
                note_pixels(found, body, row, first, column, column - first)
    return found[found[:, 5] > 0]


def boxes_of_window(ids: Integers, window: PixelWindow) -> Integers:
    """The table of the boxes in the ids of a window, counted from the corner of the picture."""
    left, top, _, _ = window
    boxes: Integers = visible_boxes(ids) + np.array([0, left, top, left, top, 0])
    return boxes


@compiled()
def note_pixels(found: Integers, body: int, row: int, first: int, end: int, pixels: int) -> None:
    """Take into the table `found`, which has a row for every possible id, zeros at first, that a
    body has so many `pixels` from the column `first` to the one before `end`. Rows come in order.
    """
    if found[body, 5] == 0:
        found[body, 0], found[body, 1], found[body, 2] = body, first, row
    # The top stays as it began, and the bottom is this row's.
    found[body, 1] = min(found[body, 1], first)
    found[body, 3] = max(found[body, 3], end)
    found[body, 4] = row + 1
    found[body, 5] += pixels


@compiled()
def moved_up(found: Integers) -> int:
    """Move the rows of `found` that have pixels to its beginning; how many they are."""
    filled = 0
    for n in range(len(found)):
        if found[n, 5] > 0:
            for k in range(6):
                found[filled, k] = found[n, k]
            filled += 1
    return filled
