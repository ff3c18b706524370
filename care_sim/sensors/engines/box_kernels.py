"""The boxes of what a picture of body ids shows, compiled."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers
from care_sim.world.bullet import NO_BODY


@compiled()
def visible_boxes(ids: Integers) -> Integers:
    """(n, 6) the bodies in a picture of ids (height, width) in ascending order: id; left, top,
    right, bottom of the box that holds all its pixels; their number.
    """
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
                one = found[body]
                if one[5] == 0:
                    one[:3] = body, first, row
                # Rows come in order, so the top stays as it began, and the bottom is this row's.
                one[1] = min(one[1], first)
                one[3] = max(one[3], column)
                one[4] = row + 1
                one[5] += column - first
    return found[found[:, 5] > 0]
