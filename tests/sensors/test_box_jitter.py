"""Jitter of boxes: its spread relative to the box, and that boxes stay in their picture."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.sensors.camera_errors import LEAST_PX, jittered
from care_sim.sensors.pictures import FRONT_CAMERA

SPREADS = (0.1, 0.02, 0.15, 0.05)


def errors(boxes, draws, spreads=SPREADS):
    boxes, draws = np.asarray(boxes, float), np.asarray(draws, float)
    zeros = np.zeros(len(boxes), np.int64)
    return jittered(boxes, draws, np.tile(spreads, (len(boxes), 1)), zeros, [FRONT_CAMERA])


def test_middle_draws_and_no_spread_leave_a_box_as_it_is():
    box = [[100.0, 50.0, 140.0, 110.0]]
    assert errors(box, [[0.5] * 4]) == pytest.approx(np.array(box))
    assert errors(box, [[0.1, 0.9, 0.3, 0.7]], [0.0] * 4) == pytest.approx(np.array(box))


def test_one_sigma_moves_and_stretches_by_the_spread():
    one_sigma = 0.8413447460685429
    ((left, top, right, bottom),) = errors([[100.0, 50.0, 140.0, 110.0]], [[one_sigma] * 4])
    assert (left + right) / 2 == pytest.approx(120.0 + 0.1 * 40)
    assert (top + bottom) / 2 == pytest.approx(80.0 + 0.02 * 60)
    assert right - left == pytest.approx(40 * np.exp(0.15))
    assert bottom - top == pytest.approx(60 * np.exp(0.05))


EDGES = st.tuples(st.floats(0, 318), st.floats(0, 178), st.floats(1, 320), st.floats(1, 180))


@given(EDGES, st.lists(st.floats(1e-9, 1 - 1e-9), min_size=4, max_size=4))
def test_a_box_stays_a_box_within_its_picture(edges, draws):
    left, top, width, height = edges
    box = [left, top, min(left + width, 320), min(top + height, 180)]
    ((a, b, c, d),) = errors([box], [draws])
    assert 0 <= a <= c - LEAST_PX + 1e-9
    assert 0 <= b <= d - LEAST_PX + 1e-9
    assert c <= 320
    assert d <= 180
