"""Actors that were never detected, against quartiles and bounds worked by hand."""

import pytest

from care_sim.evaluation.bootstrap import Interval
from care_sim.evaluation.censoring import Bound, Difference, Quartiles, Reading, difference, quartiles

MISSED = Reading(3.0, censored=True)


def readings(*values):
    return [MISSED if value is None else Reading(value) for value in values]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([16.0, 15.0, 19.0, 17.0, 18.0], (16.0, 17.0, 18.0)),
        ([4.0, None, 8.0, 6.0, None], (None, 4.0, 6.0)),
        ([None, 8.0], (None, None, None)),
        ([None, 6.0, 8.0], (None, 6.0, 7.0)),
        ([None, None, None, 8.0], (None, None, None)),
        ([None], (None, None, None)),
    ],
)
def test_a_miss_ranks_below_every_detection_and_nothing_is_interpolated_with_it(values, expected):
    assert quartiles(readings(*values)) == Quartiles(*expected, len(values))


def test_even_a_detection_nearer_than_the_bound_ranks_above_a_miss():
    assert quartiles([MISSED, Reading(1.0), Reading(2.0)]).median == 1.0


def test_there_are_no_quartiles_of_nothing():
    assert quartiles([]) is None


@pytest.mark.parametrize(
    ("ours", "theirs", "mean", "bound"),
    [
        ([5.0, 5.0], [4.0, 4.0], 1.0, Bound.EXACT),
        ([5.0, None], [5.0, 5.0], -1.0, Bound.AT_MOST),
        ([5.0, 5.0], [5.0, None], 1.0, Bound.AT_LEAST),
        ([5.0, None], [None, 5.0], 0.0, Bound.OPEN),
        ([5.0, None], [5.0, None], 0.0, Bound.OPEN),
    ],
)
def test_a_miss_counts_with_the_most_it_can_have_been_and_makes_a_bound(ours, theirs, mean, bound):
    found = difference(readings(*ours), readings(*theirs))
    assert (found.interval.mean, found.bound, found.pairs) == (mean, bound, 2)


@pytest.mark.parametrize(
    ("low", "high", "bound", "excludes"),
    [
        (1.0, 2.0, Bound.EXACT, True),
        (-2.0, -1.0, Bound.EXACT, True),
        (0.0, 2.0, Bound.EXACT, False),
        (-1.0, 2.0, Bound.EXACT, False),
        (1.0, 2.0, Bound.AT_LEAST, True),
        (-2.0, -1.0, Bound.AT_LEAST, False),
        (-2.0, -1.0, Bound.AT_MOST, True),
        (1.0, 2.0, Bound.AT_MOST, False),
        (1.0, 2.0, Bound.OPEN, False),
    ],
)
def test_a_bound_carries_a_claim_only_away_from_zero(low, high, bound, excludes):
    assert Difference(Interval((low + high) / 2, low, high), bound, 5).excludes_zero == excludes


def test_four_pairs_carry_no_claim():
    assert not Difference(Interval(2.0, 1.0, 3.0), Bound.EXACT, 4).excludes_zero
