"""What a secret closes, and that without one every stream is the seed's as it always was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import check_secret, secret_entropy, streams


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
