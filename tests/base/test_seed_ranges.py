"""Which seeds are for what."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.seed_ranges import check_benchmark_seeds, training_seeds


def test_test_seeds_end_where_seeds_begin_that_something_is_chosen_by():
    check_benchmark_seeds([1999, 0])
    with pytest.raises(InvalidInput, match=r"must lie below 2,000, got 2000"):
        check_benchmark_seeds([3, 2000])


def test_training_seeds_are_counted_from_the_first():
    assert list(training_seeds(3)) == [10_000, 10_001, 10_002]
