"""Seeds for training, for choosing and for the published figures."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.scenarios.splits import SPLITS, split_of


@pytest.mark.parametrize("name", SPLITS)
def test_the_ends_of_a_split_are_of_it(name):
    assert split_of([SPLITS[name][0], SPLITS[name][-1]]) == name


def test_no_seed_is_of_two_splits():
    seeds = [seed for split in SPLITS.values() for seed in split]
    assert len(seeds) == len(set(seeds))


@pytest.mark.parametrize(
    ("seeds", "complaint"),
    [
        ([0, 20_000], r"of one split \(train 0 to 9999, .*\), got seeds of train and test"),
        ([], "got no seed"),
        ([9_999, 19_999], "seed 19999 is of no split; there are train 0 to 9999, validation"),
        ([-1], "seed must be"),
    ],
)
def test_seeds_that_are_mixed_or_of_none_are_refused_in_one_line(seeds, complaint):
    with pytest.raises(InvalidInput, match=complaint) as refusal:
        split_of(seeds)
    assert "\n" not in str(refusal.value)
