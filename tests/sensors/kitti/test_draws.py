"""Chance of the profile `kitti`: how long it lasts, and that hashes are even and normal."""

import numpy as np
import pytest
from scipy.stats import kstest

from care_sim.base.hashing import normal, uniform
from care_sim.sensors.kitti.draws import PersistentNormals, Renewals, key_of

KEYFRAME_S = 0.1


@pytest.mark.parametrize(
    ("lasting", "share", "time_s"), [(0.0, 0.76, 1.29), (0.36, 0.44, 0.49), (0.0, 1.0, 0.3)]
)
def test_normal_numbers_are_correlated_as_stated(lasting, share, time_s):
    draws = PersistentNormals(
        4000, [lasting], [share], [time_s], KEYFRAME_S, np.random.default_rng(0)
    )
    numbers = np.array([draws.next()[:, 0] for _ in range(40)])
    assert numbers.std(axis=1) == pytest.approx(np.ones(40), abs=0.05)
    for lag in (1, 3, 10, 30):
        expected = lasting + share * np.exp(-lag * KEYFRAME_S / time_s)
        measured = np.mean(numbers[lag:] * numbers[:-lag])
        assert measured == pytest.approx(expected, abs=0.03)


def test_states_stay_as_long_as_stated():
    states = Renewals((5000,), 0.24, KEYFRAME_S, np.random.default_rng(0))
    begun = np.array([states.next() for _ in range(8)])
    for lag in (1, 2, 5):
        stayed = np.mean(begun[lag:] == begun[:-lag])
        assert stayed == pytest.approx(np.exp(-lag * KEYFRAME_S / 0.24), abs=0.01)


def test_hashes_are_even_and_normal_and_depend_on_every_number_of_the_key():
    keys = [np.uint64(key_of(np.uint64(7), n, m, 3)) for n in range(60) for m in range(60)]
    assert len({*keys}) == len(keys)
    even = np.array([uniform(key, 0) for key in keys])
    bell = np.array([normal(key, 5) for key in keys])
    assert kstest(even, "uniform").pvalue > 0.01
    assert kstest(bell, "norm").pvalue > 0.01
    neighbours = np.corrcoef(even[1:], even[:-1])[0, 1], np.corrcoef(even, bell)[0, 1]
    assert np.abs(neighbours).max() < 0.05
