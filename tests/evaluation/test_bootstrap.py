import warnings

import numpy as np
import pytest
from scipy import stats

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.bootstrap import paired_difference, ratio_of_sums


def test_two_differences_have_a_distribution_known_by_hand():
    """Means of two draws from {0, 1}: 0, 1/2, 1 with probabilities 1/4, 1/2, 1/4."""
    assert paired_difference([1.0, 1.0], [1.0, 0.0]) == (0.5, 0.0, 1.0)


def test_many_differences_agree_with_the_normal_theory():
    a = np.random.default_rng(1).normal(3.0, 2.0, 2000)
    b = np.random.default_rng(2).normal(0.0, 1.0, 2000)
    mean, low, high = paired_difference(a, b)
    error = 1.959964 * np.std(a - b) / np.sqrt(2000)
    assert mean == pytest.approx(np.mean(a - b))
    assert (mean - low, high - mean) == pytest.approx((error, error), rel=0.05)


@pytest.mark.parametrize(
    ("ours", "theirs"), [([3.0], [1.0]), ([0.1 + 0.2, 16.2], [0.1, 16.0]), (range(5), range(-2, 3))]
)
def test_equal_differences_are_certain_and_silent(ours, theirs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mean, low, high = paired_difference(ours, theirs)
    assert low == mean == high
    assert mean == pytest.approx(ours[0] - theirs[0])


@pytest.mark.parametrize("count", [2, 20, 129])
def test_intervals_are_those_of_scipy(count):
    samples = np.random.default_rng(count).normal(size=count)
    theirs = stats.bootstrap(
        (samples,), np.mean, n_resamples=10_000, method="percentile", rng=np.random.default_rng(0)
    )
    assert paired_difference(samples, np.zeros(count))[1:] == theirs.confidence_interval


@pytest.mark.parametrize(
    ("ours", "theirs"), [([], []), ([1.0], [1.0, 2.0]), ([np.nan], [1.0]), ([[1.0]], [[1.0]])]
)
def test_samples_that_are_no_pairs_are_refused(ours, theirs):
    with pytest.raises(InvalidInput):
        paired_difference(ours, theirs)


def test_two_ratios_have_a_distribution_known_by_hand():
    """Scenes 1/1 and 0/3: drawn twice the first 1, one of each 1/4, twice the second 0."""
    assert ratio_of_sums(([1.0, 0.0], [1.0, 3.0])) == (0.25, 0.0, 1.0)


def test_a_resample_without_a_denominator_is_ignored():
    """Scenes 2/1 and 1/0: drawn twice the first 2, one of each 3, and the second twice nothing."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ratio_of_sums(([2.0, 1.0], [1.0, 0.0])) == (3.0, 2.0, 3.0)
        gap = ratio_of_sums(([2.0, 1.0], [1.0, 0.0]), less=([1.0, 1.0], [1.0, 1.0]))
    assert gap == (2.0, 1.0, 2.0)
    assert ratio_of_sums(([1.0, 0.0, 2.0], [2.0, 0.0, 4.0])) == (0.5, 0.5, 0.5)


def test_a_ratio_of_equal_denominators_is_the_paired_difference():
    a = np.random.default_rng(6).normal(size=40)
    assert ratio_of_sums((a * 3.0, np.full(40, 3.0))) == pytest.approx(
        paired_difference(a, np.zeros(40))
    )


def test_a_second_group_is_taken_off_and_drawn_by_itself():
    rng = np.random.default_rng(8)
    first, second = ((rng.normal(mean, 1.0, 500), np.ones(500)) for mean in (3.0, 1.0))
    gap = ratio_of_sums(first, less=second)
    error = 1.959964 * np.sqrt((np.var(first[0]) + np.var(second[0])) / 500)
    assert gap.mean == pytest.approx(first[0].mean() - second[0].mean())
    assert (gap.mean - gap.low, gap.high - gap.mean) == pytest.approx((error, error), rel=0.05)


def test_equal_ratios_are_certain_and_silent_and_draws_are_seeded():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ratio_of_sums(([1.0, 2.0, 0.5], [2.0, 4.0, 1.0])) == (0.5, 0.5, 0.5)
        assert ratio_of_sums(([7.0], [10.0])) == (0.7, 0.7, 0.7)
        assert ratio_of_sums(([7.0], [10.0]), less=([2.0, 1.0], [10.0, 5.0])) == pytest.approx(
            (0.5, 0.5, 0.5)
        )
    sums = np.random.default_rng(9).random((2, 12)) + 0.5
    assert ratio_of_sums(tuple(sums)) == ratio_of_sums(tuple(sums))


def test_an_interval_that_was_drawn_once_is_remembered():
    """The very same one is given, not an equal one that was drawn again; other draws are others."""
    ours, theirs = np.random.default_rng(10).random((2, 12)) + 0.5
    difference, ratio = paired_difference(ours, theirs), ratio_of_sums((ours, theirs))
    assert paired_difference(ours.tolist(), theirs.tolist()) is difference
    assert ratio_of_sums((ours.tolist(), theirs.tolist())) is ratio
    assert ratio_of_sums((ours, theirs), less=(theirs, ours)) is not ratio


@pytest.mark.parametrize(
    ("sums", "less"),
    [
        (([], []), None),
        (([1.0], [1.0, 2.0]), None),
        (([np.nan], [1.0]), None),
        (([1.0, 1.0], [0.0, 0.0]), None),
        (([1.0, 1.0], [3.0, -1.0]), None),
        (([1.0, 2.0], [1.0, 1.0]), ([1.0, 2.0], [0.0, 0.0])),
    ],
)
def test_sums_that_have_no_ratio_are_refused(sums, less):
    with pytest.raises(InvalidInput):
        ratio_of_sums(sums, less=less)


def skewed(rng, n):
    """Differences with a long tail, mean 3."""
    return 2.0 + rng.exponential(1.0, n)


def rare_steps(rng, n):
    """One episode in ten differs, by one keyframe; mean 0.08."""
    return 0.8 * (rng.random(n) < 0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("draw", "truth", "n", "least", "most"),
    [
        (skewed, 3.0, 30, 0.87, 0.97),
        (skewed, 3.0, 5, 0.72, 0.82),
        (rare_steps, 0.08, 30, 0.92, 0.99),
        (rare_steps, 0.08, 5, 0.35, 0.47),
    ],
)
def test_how_often_the_interval_holds_the_truth(draw, truth, n, least, most):
    """Near 95% at the 30 seeds of a sweep; at five seeds it falls well short, and the captions say
    how far.
    """
    rng = np.random.default_rng(5)
    trials, held = 400, 0
    for _ in range(trials):
        _, low, high = paired_difference(draw(rng, n), np.zeros(n))
        held += low - 1e-9 <= truth <= high + 1e-9
    assert least <= held / trials <= most
