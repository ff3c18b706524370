import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.envs.reward import KEEP_CLEAR_M, REWARD_WEIGHTS, Potential, terms, weights
from care_sim.loops.records import Keyframe


def keyframe(**changes):
    quiet = {
        "index": 0,
        "time_s": 0.0,
        "fired": np.arange(3),
        "in_view": False,
        "detected": False,
        "braking": False,
        "speed_mps": 8.0,
        "distance_m": 30.0,
        "nearest_m": 30.0,
        "clearance_m": 20.0,
        "impact_speed_mps": None,
    }
    return Keyframe(**{**quiet, **changes})


def nothing(**changes):
    return {
        "delay": 0.0,
        "clearance": 0.0,
        "collision": 0.0,
        "braking": 0.0,
        "gain": 0.0,
        **changes,
    }


@pytest.mark.parametrize(
    ("frame", "before", "expected"),
    [
        ({}, (False, False), {}),
        ({"in_view": True}, (False, False), {"delay": -1.0}),
        ({"in_view": False}, (True, False), {"delay": -1.0}),
        ({"in_view": True, "detected": True}, (True, False), {}),
        ({"in_view": True}, (True, True), {}),
        ({"braking": True}, (False, False), {"braking": -1.0}),
        ({"braking": True, "in_view": True, "detected": True}, (False, False), {}),
        ({"braking": True}, (True, True), {}),
        ({"clearance_m": 0.5}, (False, False), {}),
        ({"clearance_m": KEEP_CLEAR_M}, (True, True), {}),
        ({"clearance_m": KEEP_CLEAR_M / 4}, (True, True), {"clearance": -0.75}),
        (
            {"clearance_m": -0.3, "impact_speed_mps": 4.0},
            (True, True),
            {"clearance": -1.0, "collision": -1.0},
        ),
        ({"clearance_m": np.inf, "impact_speed_mps": 0.0}, (False, False), {"collision": -1.0}),
    ],
)
def test_terms(frame, before, expected):
    now = keyframe(**frame)
    assert terms(now, before[0] or now.in_view, before[1] or now.detected) == nothing(**expected)


def test_a_weight_is_changed_by_name_and_the_rest_stays():
    assert weights(None) == REWARD_WEIGHTS
    assert weights({"delay": 5.0}) == {**REWARD_WEIGHTS, "delay": 5.0}
    assert REWARD_WEIGHTS["delay"] == 1.0


def test_an_unknown_term_is_refused_with_the_known_ones():
    with pytest.raises(InvalidInput, match=r"'speed'.*braking, clearance, collision, delay"):
        weights({"speed": 1.0})


def test_every_term_has_a_weight():
    assert set(terms(keyframe(), False, False)) == set(REWARD_WEIGHTS)


def losses(*frames):
    """What a potential loses at keyframes of (distance, whether a full scan detects, whether it was
    detected).
    """
    potential = Potential()
    last = len(frames) - 1
    return [
        potential.advance(
            keyframe(distance_m=distance, detected=detected), detectable, number == last
        )
        for number, (distance, detectable, detected) in enumerate(frames)
    ]


def test_nothing_is_lost_before_a_full_scan_would_detect_nor_when_it_is_found_at_once():
    assert losses(
        (20.0, False, False), (16.0, True, True), (12.0, True, False), (8.0, True, True)
    ) == [0, 0, 0, 0]


def test_what_is_lost_until_the_detection_is_the_share_of_the_bound():
    assert losses(
        (16.0, True, False), (12.0, True, False), (8.0, False, True), (4.0, True, False)
    ) == [
        0,
        0.25,
        0.25,
        0,
    ]


def test_all_is_lost_without_a_detection_by_the_end_and_nothing_where_none_was_possible():
    assert losses((16.0, True, False), (12.0, True, False), (12.0, True, False)) == [0, 0.25, 0.75]
    assert losses((16.0, False, False), (12.0, False, False)) == [0, 0]


def test_an_actor_that_draws_away_gives_nothing_back():
    assert losses((16.0, True, False), (8.0, True, False), (12.0, True, True)) == [0, 0.5, 0]


@given(st.lists(st.tuples(st.floats(0.5, 50.0), st.booleans(), st.booleans()), min_size=1))
def test_the_losses_are_positive_and_sum_to_one_at_most(frames):
    lost = losses(*frames)
    assert min(lost) >= 0
    assert sum(lost) <= 1 + 1e-9


def test_the_term_is_what_is_lost():
    assert terms(keyframe(), False, False, lost=0.25) == nothing(gain=-0.25)
