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


def skewed(rng, n):
    """Differences with a long tail, mean 3."""
    return 2.0 + rng.exponential(1.0, n)


def steps(rng, n):
    """Differences in whole keyframes of 0.8 m, mean 1.2."""
    return 0.8 * rng.poisson(1.5, n)


def rare_steps(rng, n):
    """One episode in ten differs, by one keyframe; mean 0.08."""
    return 0.8 * (rng.random(n) < 0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("draw", "truth", "n", "least", "most"),
    [
        (skewed, 3.0, 60, 0.90, 0.98),
        (skewed, 3.0, 30, 0.87, 0.97),
        (skewed, 3.0, 5, 0.72, 0.82),
        (steps, 1.2, 30, 0.90, 0.98),
        (steps, 1.2, 5, 0.76, 0.87),
        (rare_steps, 0.08, 30, 0.92, 0.99),
        (rare_steps, 0.08, 5, 0.35, 0.47),
    ],
)
def test_how_often_the_interval_holds_the_truth(draw, truth, n, least, most):
    """Near 95% at the 30 seeds of a sweep; at five seeds it falls well short, and the captions say how far."""
    rng = np.random.default_rng(5)
    trials, held = 400, 0
    for trial in range(trials):
        _, low, high = paired_difference(draw(rng, n), np.zeros(n), resamples=1000, seed=trial)
        held += low - 1e-9 <= truth <= high + 1e-9
    assert least <= held / trials <= most
