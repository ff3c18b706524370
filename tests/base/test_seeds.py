"""Which seeds are for what, and the streams that each holds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import (
    SPLITS,
    check_benchmark_seeds,
    check_secret,
    secret_entropy,
    split_of,
    streams,
)


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


def states(sequences):
    return [sequence.generate_state(4).tolist() for sequence in sequences]


@given(st.integers(0, 2**63 - 1), st.integers(0, 2**32 - 1))
def test_without_a_secret_the_streams_are_those_of_the_seed(seed, scene):
    assert states(streams((seed,), 5)) == states(np.random.SeedSequence(seed).spawn(5))
    assert states(streams((seed, scene), 4)) == states(
        np.random.SeedSequence((seed, scene)).spawn(4)
    )


@given(st.integers(0, 2**63 - 1), st.text(st.characters(codec="ascii"), min_size=1))
def test_a_secret_makes_all_of_them_others_and_the_same_ones_again(seed, secret):
    public, hidden = states(streams((seed,), 5)), states(streams((seed,), 5, secret))
    assert hidden == states(streams((seed,), 5, secret))
    drawn = [*map(tuple, public), *map(tuple, hidden)]
    assert len(set(drawn)) == len(drawn)
    for other in (
        streams((seed + 1,), 5, secret),
        streams((seed,), 5, secret + "x"),
        streams((seed, 0), 5, secret),
    ):
        assert not {*map(tuple, hidden)} & {*map(tuple, states(other))}


def test_a_street_and_an_episode_of_one_seed_and_secret_have_no_root_in_common():
    assert secret_entropy("street", (3,), "key") != secret_entropy("episode", (3,), "key")
    root = np.random.SeedSequence(secret_entropy("episode", (3,), "key"))
    assert states(streams((3,), 2, "key")) == states(root.spawn(2))


@pytest.mark.parametrize("secret", [7, b"0d5", ["0d5"], "0d5\ud800", "0d5ü"])
def test_another_secret_is_refused_in_one_line_that_does_not_tell_it(secret):
    with pytest.raises(InvalidInput, match="secret must be") as caught:
        check_secret(secret)
    assert "0d5" not in str(caught.value)
    assert "\n" not in str(caught.value)
