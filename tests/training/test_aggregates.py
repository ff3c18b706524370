"""Aggregates over training seeds, against answers worked out by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.base.errors import InvalidInput
from care_sim.training.curves import interquartile_mean, performance_profile

TABLES = arrays(float, st.tuples(st.integers(2, 5), st.integers(1, 3)),
                elements=st.floats(-100, 100).map(lambda value: round(value, 3)))  # fmt: skip


def test_the_middle_half_counts_alone():
    assert interquartile_mean(np.arange(1.0, 9.0)[None]).value == 4.5, "of 3, 4, 5 and 6"
    outliers = np.array([[-1e9, -50, 3, 4, 5, 6, 70, 1e9]])
    assert interquartile_mean(outliers).value == 4.5
    # Of five values the paper's library too leaves one out at either end.
    assert interquartile_mean([[1.0], [2.0], [3.0], [4.0], [100.0]]).value == 3.0


def test_a_single_run_has_no_interval():
    assert interquartile_mean([[1.0, 2.0]])[1:] == (None, None)
    assert str(interquartile_mean([[1.0, 2.0]])) == "1.50"


def test_runs_are_drawn_task_by_task():
    """Tasks of different heights: a bootstrap over all scores alike would draw one task more often
    than the other, and give an interval where nothing varies.
    """
    scores = [[1.0, 5.0], [1.0, 5.0], [1.0, 5.0]]
    assert interquartile_mean(scores) == (3.0, 3.0, 3.0)


def test_the_tasks_are_drawn_independently():
    """Runs that are better in one task as they are worse in the other: drawn together they would
    cancel, and the interval would vanish.
    """
    scores = np.array([[0.0, 1.0], [1.0, 0.0]] * 4)
    value, low, high = interquartile_mean(scores)
    assert value == 0.5
    assert low < 0.4
    assert high > 0.6


def test_the_interval_is_as_wide_as_theory_says():
    """Of a mean-like statistic of n normal scores about 2 * 1.96 * 1.09 / sqrt(n): the
    interquartile mean's deviation is 1.09 times the mean's.
    """
    scores = np.random.default_rng(3).normal(size=(400, 1))
    _, low, high = interquartile_mean(scores)
    assert high - low == pytest.approx(2 * 1.96 * 1.09 / 20, rel=0.15)


@settings(max_examples=25)
@given(scores=TABLES)
def test_an_interval_holds_its_value_and_moves_with_the_scores(scores):
    value, low, high = interquartile_mean(scores)
    assert scores.min() - 1e-9 <= low <= high <= scores.max() + 1e-9
    np.testing.assert_allclose(
        interquartile_mean(2 * scores + 1), 2 * np.array([value, low, high]) + 1, atol=1e-6
    )


def test_a_profile_is_the_share_above_each_level():
    profile = performance_profile([[0.0, 1.0], [2.0, 3.0]], [-1, 0, 0.5, 2, 3])
    assert [one.value for one in profile] == [1, 0.75, 0.75, 0.25, 0]
    # Above 0.5 are one of two runs in the first task and both in the second.
    assert (profile[2].low, profile[2].high) == (0.5, 1.0)
    assert profile[0][1:] == (1.0, 1.0)


def test_runs_of_a_profile_are_drawn_whole():
    """One run is above the level in all of many episodes, the other in none: with so few runs the
    share may be anything, however many episodes there are.
    """
    scores = np.repeat([[0.0], [1.0]], 50, axis=1)
    assert performance_profile(scores, 0.5) == [(0.5, 0.0, 1.0)]


@pytest.mark.parametrize("scores", [[], [1.0, 2.0], [[1.0, np.nan]], [[]]])
def test_what_is_no_table_of_scores_is_refused(scores):
    with pytest.raises(InvalidInput, match=r"scores must be finite \(runs, tasks\)"):
        interquartile_mean(scores)
