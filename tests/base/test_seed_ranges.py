"""Which seeds are for what."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import SPLITS, check_benchmark_seeds, split_of


def test_test_seeds_end_where_seeds_begin_that_something_is_chosen_by():
    check_benchmark_seeds([999, 0])
    with pytest.raises(InvalidInput, match=r"must lie below 1,000, got 1019"):
        check_benchmark_seeds([1000, 1019])
    with pytest.raises(InvalidInput, match=r"got 3 of test and 2000 of validation"):
        check_benchmark_seeds([3, 2000])


@pytest.mark.parametrize("name", SPLITS)
def test_the_ends_of_a_split_are_of_it(name):
    assert split_of([SPLITS[name][0], SPLITS[name][-1]]) == name


@pytest.mark.parametrize(
    ("seeds", "complaint"),
    [
        ([0, 5, 10_000], r"of one split \(test 0 to 999, .*\), got 0 of test and 10000 of train"),
        (range(1_001), r"got 0 of test and 1000 of calibration"),
        ([], "got no seed"),
        ([2**31], r"seed 2147483648 is of no split; there are test 0 to 999, calibration"),
        ([-1], "seed must be"),
    ],
)
def test_seeds_that_are_mixed_or_of_none_are_refused_in_one_line(seeds, complaint):
    with pytest.raises(InvalidInput, match=complaint) as refusal:
        split_of(seeds)
    assert "\n" not in str(refusal.value)
