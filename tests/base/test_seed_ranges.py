"""Which seeds are for what."""

import time

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import SPLITS, check_benchmark_seeds, split_of, training_seeds


def test_test_seeds_end_where_seeds_begin_that_something_is_chosen_by():
    check_benchmark_seeds([999, 0])
    with pytest.raises(InvalidInput, match=r"must lie below 1,000, got 1019"):
        check_benchmark_seeds([1000, 1019])
    with pytest.raises(InvalidInput, match=r"got 3 of test and 2000 of validation"):
        check_benchmark_seeds([3, 2000])


def test_training_seeds_are_counted_from_the_first():
    assert list(training_seeds(3)) == [10_000, 10_001, 10_002]


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


def test_a_seed_of_numpy_is_found_as_quickly():
    begin = time.perf_counter()
    assert split_of([np.int64(2_000_000_000)]) == "train"
    assert time.perf_counter() - begin < 1.0
