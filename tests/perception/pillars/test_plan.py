"""Which pillar a point stands in, and what is told of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.perception.pillars.network import (
    CELL_M,
    OWN_ROOF_M,
    PILLAR_M,
    PILLARS,
    POINT_INPUTS,
    REACH_M,
    cell_centres,
    on_plan,
)

HEIGHT = 1.84
PLACES = st.floats(-60, 60)


def test_a_point_is_told_by_its_place_in_its_pillar_its_height_and_its_bearing():
    seen = on_plan(np.array([[10.1, -3.2, -0.84]]), HEIGHT)
    assert seen.pillars.tolist() == [124 * PILLARS + 97]
    told = dict(zip(POINT_INPUTS, seen.inputs[0].tolist(), strict=True))
    range_m = np.hypot(10.1, 3.2)
    assert told == pytest.approx(
        {
            "dx": (10.1 - 10.25) / 0.25,
            "dy": (-3.2 + 3.25) / 0.25,
            "height": 1.0,
            "low": 1.0,
            "range": range_m / REACH_M,
            "cos": 10.1 / range_m,
            "sin": -3.2 / range_m,
            "z": -0.84,
        },
        abs=1e-5,
    )


@given(PLACES, PLACES, st.floats(-4, 8))
def test_points_off_the_plan_are_left_out_and_the_others_lie_in_their_pillar(x, y, z):
    seen = on_plan(np.array([[x, y, z]]), HEIGHT)
    beside = max(abs(x), abs(y)) < REACH_M and np.hypot(x, y) > OWN_ROOF_M
    if not (beside and -1 < z + HEIGHT < 4.5):
        assert len(seen.inputs) == len(seen.pillars) == 0
        return
    row, column = divmod(int(seen.pillars[0]), PILLARS)
    for place, number in ((x, row), (y, column)):
        assert 0 <= number < PILLARS
        assert (
            number * PILLAR_M - REACH_M - 1e-9 <= place <= (number + 1) * PILLAR_M - REACH_M + 1e-9
        )
    assert np.abs(seen.inputs[0, :2]).max() <= 1 + 1e-6


def test_cells_cover_the_plan():
    x, y = cell_centres()
    assert x[0, 0] - CELL_M / 2 == -REACH_M
    assert x[-1, 0] + CELL_M / 2 == REACH_M
    assert np.array_equal(x[:, 0], y[0])
