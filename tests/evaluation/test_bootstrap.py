import warnings

import numpy as np
import pytest

from care_sim.errors import InvalidInput
from care_sim.evaluation.bootstrap import paired_difference


def test_two_differences_have_a_distribution_known_by_hand():
    """Means of two draws from {0, 1}: 0, 1/2, 1 with probabilities 1/4, 1/2, 1/4."""
    assert paired_difference([1.0, 1.0], [1.0, 0.0]) == (0.5, 0.0, 1.0)
    middle = paired_difference([1.0, 1.0], [1.0, 0.0], confidence=0.4)
    assert middle == (0.5, 0.5, 0.5)


def test_many_differences_agree_with_the_normal_theory():
    a = np.random.default_rng(1).normal(3.0, 2.0, 2000)
    b = np.random.default_rng(2).normal(0.0, 1.0, 2000)
    mean, low, high = paired_difference(a, b)
    error = 1.959964 * np.std(a - b) / np.sqrt(2000)
    assert mean == pytest.approx(np.mean(a - b))
    assert (mean - low, high - mean) == pytest.approx((error, error), rel=0.05)


def test_pairing_removes_what_the_pairs_share():
    shared = np.random.default_rng(3).normal(0.0, 100.0, 50)
    mean, low, high = paired_difference(shared + 1.0 + np.linspace(-0.1, 0.1, 50), shared)
    assert low > 0.9
    assert high < 1.1
    assert mean == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("ours", "theirs"), [([3.0], [1.0]), ([0.1 + 0.2, 16.2], [0.1, 16.0]), (range(5), range(-2, 3))]
)
def test_equal_differences_are_certain_and_silent(ours, theirs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mean, low, high = paired_difference(ours, theirs)
    assert low == mean == high
    assert mean == pytest.approx(ours[0] - theirs[0])


def test_the_same_samples_give_the_same_interval():
    a = np.random.default_rng(4).normal(size=20)
    assert paired_difference(a, np.zeros(20)) == paired_difference(a, np.zeros(20))


@pytest.mark.parametrize(("ours", "theirs"), [([], []), ([1.0], [1.0, 2.0]), ([np.nan], [1.0]), ([[1.0]], [[1.0]])])
def test_samples_that_are_no_pairs_are_refused(ours, theirs):
    with pytest.raises(InvalidInput):
        paired_difference(ours, theirs)


@pytest.mark.slow
def test_the_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(5)
    trials, covered = 400, 0
    for trial in range(trials):
        noise = rng.exponential(1.0, 60)
        _, low, high = paired_difference(2.0 + noise, np.zeros(60), resamples=1000, seed=trial)
        covered += low <= 3.0 <= high
    assert 0.90 <= covered / trials <= 0.98
