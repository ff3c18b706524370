"""Places moved apart."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from care_sim.reports.figures.apart import apart

PLACES = st.lists(st.tuples(*[st.floats(-20, 20)] * 2), min_size=1, max_size=20).map(
    lambda places: np.array(places, float)
)


def distances(places):
    between = places[:, None] - places[None]
    return np.hypot(between[..., 0], between[..., 1]) + np.where(np.eye(len(places)), np.inf, 0)


@given(PLACES)
def test_no_two_stay_near_each_other(places):
    moves = apart(places, least=2.0)
    assert distances(places + moves).min() > 0.95 * 2.0


@given(PLACES)
def test_places_that_are_apart_stay(places):
    settled = places + apart(places, least=2.1)
    assert not apart(settled, least=2.0).any()
    far = np.vstack([places, [[1000.0, 1000.0]]])
    assert not apart(far, least=2.0)[-1].any()


def test_two_at_one_place_go_half_the_way_each():
    moves = apart(np.array([[3.0, 4.0], [3.0, 4.0]]), least=2.0)
    assert np.allclose(np.hypot(*moves.T), 1.0, atol=0.01)
    assert np.allclose(moves.sum(axis=0), 0.0, atol=0.01)
