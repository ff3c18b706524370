"""The same happened, the same bytes: last bits do not count, a millimetre does."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_sim.base.digests import portable_bytes
from care_sim.sensors.annotated import NO_ANNOTATIONS, Annotations
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode
from care_sim.study.scene_play import film_hash
from tests.helpers.places import ROOT
from tests.helpers.processor_features import WIDE, without_avx512
from tests.helpers.short_streets import part_of

EPISODES = [("cutin", "care", 0), ("dense", "history", 3)]
"""The car that cuts in is turned by an arctangent."""


def hashes():
    episodes = [
        run_episode(EpisodeConfig(*named, seed=seed))["episode_hash"] for *named, seed in EPISODES
    ]
    return [*episodes, film_hash(some_keyframes(make_street(1)))]


def some_keyframes(street):
    return record(part_of(street, slice(14, 17)))


@pytest.mark.skipif(not WIDE, reason="there is no AVX-512 here to do without")
def test_a_processor_without_avx512_gives_the_same_hashes():
    line = "import json; from tests.base.test_digests import hashes; print(json.dumps(hashes()))"
    child = subprocess.run(
        [sys.executable, "-c", line],
        cwd=ROOT,
        env=without_avx512(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(child.stdout.splitlines()[-1]) == hashes()


@pytest.mark.parametrize(
    "value", [0.0, 0.5, 1.5, 0.05, 0.1, 1e-4, 5e-5, 12.34565, -0.25, -3e-4, 50.0, 1e6]
)
def test_round_numbers_are_not_on_a_border(value):
    near = [value * (1 - 1e-13) - 1e-13, value, value * (1 + 1e-13) + 1e-13]
    assert len({portable_bytes(one) for one in near}) == 1


def test_zero_has_no_sign_and_float32_is_not_another_number():
    assert portable_bytes(-0.0) == portable_bytes(0.0)
    assert portable_bytes(np.float32(1.5)) == portable_bytes(1.5)
    assert portable_bytes(np.float32(7.123456)) == portable_bytes(7.123456)
    assert portable_bytes(np.arange(3, dtype=np.int32)) == portable_bytes([0, 1, 2])


def test_what_is_not_finite_is_told_apart():
    strange = [np.inf, -np.inf, np.nan, 0.0, 1e300, -1e300]
    assert len({portable_bytes(one) for one in strange}) == len(strange)
    assert portable_bytes([np.inf, 1.0]) == portable_bytes([np.inf, 1.0 + 1e-12])


@given(
    arrays(np.float64, 5, elements=st.floats(-1e5, 1e5)),
    st.integers(0, 4),
    st.sampled_from([0.001, -0.001, 0.01]),
)
def test_a_millimetre_is_noticed(values, place, change):
    moved = values.copy()
    moved[place] += change
    assert portable_bytes(moved) != portable_bytes(values)


@given(st.lists(st.integers(-(2**60), 2**60), min_size=1, max_size=5), st.integers(0, 4))
def test_whole_numbers_are_taken_exactly(values, place):
    assume(place < len(values))
    other = [value + (n == place) for n, value in enumerate(values)]
    assert portable_bytes(np.array(other, np.int64)) != portable_bytes(np.array(values, np.int64))


def test_parts_do_not_run_into_each_other():
    assert portable_bytes([1, 2], [3]) != portable_bytes([1], [2, 3]) != portable_bytes([1, 2, 3])
    assert portable_bytes("a\udcff") != portable_bytes("a?")
    assert portable_bytes("ab", "c") != portable_bytes("a", "bc")
    assert portable_bytes(((1, 2), 3)) != portable_bytes((1, (2, 3)))
    assert portable_bytes(np.zeros((2, 3), int)) != portable_bytes(np.zeros((3, 2), int))


def test_who_is_hidden_at_the_start_of_a_film_counts():
    film = some_keyframes(make_street(1))
    behind = Annotations(
        np.array([900]), np.array([0]), np.array([[9.0, 2.0, 0.0, 4.0, 2.0, 1.5, 0.0]])
    )
    farther = replace(behind, boxes=behind.boxes + 0.01)
    assert (
        len(
            {
                film_hash(replace(film, hidden=hidden))
                for hidden in (NO_ANNOTATIONS, behind, farther)
            }
        )
        == 3
    )
