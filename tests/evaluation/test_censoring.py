"""Actors that were never detected, against quartiles and bounds worked by hand."""

import pytest

from care_sim.evaluation.censoring import Bound, Quartiles, Reading, difference, quartiles

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
    ("ours", "theirs", "excludes", "cautious"),
    [
        ([5.0] * 5, [4.0] * 5, True, 1.0),
        ([5.0] * 5, [5.0] * 5, False, 0.0),
        ([9.0] * 5, [2.0] * 4 + [None], True, 6.8),
        ([9.0] * 4 + [None], [8.0] * 5, False, -0.2),
        ([19.0] * 9 + [None], [8.0] * 10, True, 9.1),
        ([2.0] * 4 + [None], [9.0] * 5, True, -6.8),
        ([8.0] * 9 + [None], [19.0] * 9 + [None], True, -9.6),
        ([None] * 5, [2.0] * 5, False, -2.0),
    ],
)
def test_a_claim_holds_wherever_in_its_range_a_missed_distance_lies(
    ours, theirs, excludes, cautious
):
    """Missed, an actor was between 0 and 3 m away: at 0 where that speaks against the difference,
    else at 3.
    """
    found, turned = (
        difference(readings(*ours), readings(*theirs)),
        difference(readings(*theirs), readings(*ours)),
    )
    assert found.excludes_zero == turned.excludes_zero == excludes
    assert found.cautious.mean == pytest.approx(cautious)
    if found.interval.mean:
        assert turned.cautious.mean == pytest.approx(-cautious)
