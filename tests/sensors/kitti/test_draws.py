"""Chance of the profile `kitti`: how long it lasts, and that hashes are even and normal."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import kstest

from care_sim.base.hashing import normal, uniform
from care_sim.core.arrays import ONE_WORLD, filled
from care_sim.sensors.kitti.draws import PersistentNormals, Renewals, key_of

KEYFRAME_S = 0.1


def test_chance_of_many_worlds_is_that_of_each_alone():
    """Worlds have their own numbers of objects, and pictures at their own times."""
    sizes, rng = (3, 0, 40), np.random.default_rng(0)
    makers = (
        partial(PersistentNormals, columns=2, lasting=0.3, share=0.4, time_s=1.0),
        partial(Renewals, states=5, time_s=0.2),
    )
    for make in makers:
        together, *apart = (make(worlds, keyframe_s=KEYFRAME_S) for worlds in (3, 1, 1, 1))
        for world, size in enumerate(sizes):
            together.begin(world, size, np.random.default_rng(world))
            apart[world].begin(0, size, np.random.default_rng(world))
        for _ in range(40):
            live = rng.random(3) < 0.7
            numbers = together.next(live)
            for world in np.flatnonzero(live).tolist():
                expected = apart[world].next(ONE_WORLD)[0, : sizes[world]]
                assert np.array_equal(numbers[world, : sizes[world]], expected)


def test_normal_numbers_are_drawn_keyframe_by_keyframe():
    """Published episodes hold the order of the draws: what lasts, then moves and fresh numbers of
    every keyframe.
    """
    lasting, share, kept = 0.36, 0.44, np.exp(-KEYFRAME_S / 0.49)
    draws = PersistentNormals(1, 1, lasting, share, 0.49, KEYFRAME_S)
    draws.begin(0, 3, np.random.default_rng(5))
    rng = np.random.default_rng(5)
    always, slow = rng.standard_normal((2, 3))
    for keyframe in range(40):
        moves, fresh = rng.standard_normal((2, 3))
        if keyframe:
            slow = kept * slow + np.sqrt(1 - kept**2) * moves
        expected = np.sqrt(lasting) * always + np.sqrt(share) * slow
        expected = expected + np.sqrt(1 - lasting - share) * fresh
        assert np.array_equal(draws.next(ONE_WORLD)[0, :3, 0], expected)


def test_tables_that_cannot_grow_both_stay_as_they_are(monkeypatch):
    draws = PersistentNormals(2, 1, 0.3, 0.5, 0.4, KEYFRAME_S)
    grown = []

    def fails_at_the_second(*given):
        grown.append(given)
        if len(grown) == 2:
            raise MemoryError
        return filled(*given)

    with monkeypatch.context() as patch:
        patch.setattr("care_sim.sensors.kitti.draws.filled", fails_at_the_second)
        with pytest.raises(MemoryError):
            draws.begin(0, 40, np.random.default_rng(0))
    for world in range(2):
        draws.begin(world, 2, np.random.default_rng(world))
    assert np.isfinite(draws.next(np.ones(2, np.bool_))).all()


@pytest.mark.parametrize(
    ("lasting", "share", "time_s"), [(0.0, 0.76, 1.29), (0.36, 0.44, 0.49), (0.0, 1.0, 0.3)]
)
def test_normal_numbers_are_correlated_as_stated(lasting, share, time_s):
    draws = PersistentNormals(1, 1, lasting, share, time_s, KEYFRAME_S)
    draws.begin(0, 4000, np.random.default_rng(0))
    numbers = np.array([draws.next(ONE_WORLD)[0, :4000, 0] for _ in range(40)])
    assert numbers.std(axis=1) == pytest.approx(np.ones(40), abs=0.05)
    for lag in (1, 3, 10, 30):
        expected = lasting + share * np.exp(-lag * KEYFRAME_S / time_s)
        measured = np.mean(numbers[lag:] * numbers[:-lag])
        assert measured == pytest.approx(expected, abs=0.03)


def test_states_stay_as_long_as_stated():
    states = Renewals(1, 1, 0.24, KEYFRAME_S)
    states.begin(0, 5000, np.random.default_rng(0))
    begun = np.array([states.next(ONE_WORLD)[0, :5000] for _ in range(8)])
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
