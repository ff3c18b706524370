"""Numbers that last: their distribution, their autocorrelation, and that no policy moves them."""

import numpy as np
import pytest

from care_sim.sensors.camera_errors import PersistentDraws

KEYFRAME_S = 0.1


def drawn(keyframes=400, objects=200, times_s=(0.2, 1.0), seed=0):
    draws = PersistentDraws(objects, times_s, KEYFRAME_S, np.random.default_rng(seed))
    return np.array([draws.next() for _ in range(keyframes)])


def test_at_every_keyframe_all_numbers_are_equally_likely():
    numbers = drawn()
    for keyframe in (0, 1, 399):
        assert np.histogram(numbers[keyframe], 4, (0, 1))[0] / 400 == pytest.approx(0.25, abs=0.07)


@pytest.mark.parametrize(("column", "time_s"), [(0, 0.2), (1, 1.0)])
@pytest.mark.parametrize("recall", [0.3, 0.9])
def test_misses_are_correlated_as_stated(column, time_s, recall):
    """The autocorrelation of misses is exp(-t / time), whatever the recall."""
    missed = drawn()[..., column] >= recall
    assert missed.mean() == pytest.approx(1 - recall, abs=0.02)
    away = missed - missed.mean()
    for lag in (1, 3, 8):
        correlation = np.mean(away[lag:] * away[:-lag]) / np.mean(away**2)
        assert correlation == pytest.approx(np.exp(-lag * KEYFRAME_S / time_s), abs=0.04)


def test_what_is_done_with_the_numbers_does_not_move_them():
    assert np.array_equal(drawn(5), drawn(5))
    assert not np.array_equal(drawn(5), drawn(5, seed=1))
    # Those of the first objects are not those of fewer objects: draws are by keyframe.
    assert drawn(3, objects=0).shape == (3, 0, 2)
