from itertools import zip_longest

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.envs.reward import KEEP_CLEAR_M, REWARD_WEIGHTS, Rewards, weights
from care_sim.loops.records import Keyframe, Records


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


def of_one(rewards, frame, *flags):
    """The reward and the terms of one world."""
    told = [np.array([flag]) for flag in (*flags, True)]
    (earned,), terms = rewards.of(Records.of([frame]), *told)
    return earned, {name: column[0] for name, column in terms.items()}


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
    rewards = Rewards(weights(None), 1)
    of_one(rewards, keyframe(in_view=before[0], detected=before[1]), False, False)
    earned, terms = of_one(rewards, keyframe(**frame), False, False)
    assert terms == nothing(**expected)
    assert earned == pytest.approx(sum(REWARD_WEIGHTS[name] * terms[name] for name in terms))


def test_a_weight_is_changed_by_name_and_the_rest_stays():
    assert weights(None) == REWARD_WEIGHTS
    assert weights({"delay": 5.0}) == {**REWARD_WEIGHTS, "delay": 5.0}
    assert REWARD_WEIGHTS["delay"] == 1.0


def losses(*frames):
    """The losses at keyframes of (distance, whether a full scan detects, whether detected)."""
    rewards = Rewards(weights({"gain": 1.0}), 1)
    last = len(frames) - 1
    terms = [
        of_one(rewards, keyframe(distance_m=at, detected=detected), detectable, number == last)[1]
        for number, (at, detectable, detected) in enumerate(frames)
    ]
    return [-term["gain"] for term in terms]


@pytest.mark.parametrize(
    ("frames", "lost"),
    [
        # Before a full scan would detect, and where the actor is found at once, nothing is.
        ([(20.0, False, False), (16.0, True, True), (12.0, True, False)], [0, 0, 0]),
        ([(16.0, True, False), (12.0, True, False), (8.0, False, True)], [0, 0.25, 0.25]),
        # Without a detection by the end all is, and nothing where none was possible.
        ([(16.0, True, False), (12.0, True, False), (12.0, True, False)], [0, 0.25, 0.75]),
        ([(16.0, False, False), (12.0, False, False)], [0, 0]),
        # An actor that draws away gives nothing back.
        ([(16.0, True, False), (8.0, True, False), (12.0, True, True)], [0, 0.5, 0]),
    ],
)
def test_what_is_lost_until_the_detection_is_the_share_of_the_bound(frames, lost):
    assert losses(*frames) == lost


@given(st.lists(st.tuples(st.floats(0.5, 50.0), st.booleans(), st.booleans()), min_size=1))
def test_the_losses_are_positive_and_sum_to_one_at_most(frames):
    lost = losses(*frames)
    assert min(lost) >= 0
    assert sum(lost) <= 1 + 1e-9


def test_without_a_weight_nothing_is_asked_nor_lost():
    rewards = Rewards(weights(None), 1)
    assert not rewards.need_bound
    assert of_one(rewards, keyframe(detected=True), False, False)[1]["gain"] == 0
    asks = Rewards(weights({"gain": 0.5}), 1)
    assert asks.need_bound
    assert of_one(asks, keyframe(), True, True) == (-0.5, nothing(gain=-1.0))
    assert not asks.need_bound


KEYFRAMES = st.builds(
    keyframe,
    in_view=st.booleans(),
    detected=st.booleans(),
    braking=st.booleans(),
    distance_m=st.floats(0.5, 50.0),
    clearance_m=st.floats(-1.0, 5.0),
    impact_speed_mps=st.none() | st.floats(0.0, 15.0),
)
MOMENTS = st.lists(st.tuples(KEYFRAMES, st.booleans(), st.booleans(), st.booleans()), max_size=20)


@given(st.lists(MOMENTS, min_size=1, max_size=3), st.sampled_from([{}, {"gain": 2.0}]))
def test_many_episodes_are_rewarded_as_each_of_them(episodes, changes):
    together = Rewards(weights(changes), len(episodes))
    apart = [Rewards(weights(changes), 1) for _ in episodes]
    pause = (keyframe(), False, False, False)
    for now in zip_longest(*episodes, fillvalue=pause):
        records = Records.of([frame for frame, *_ in now])
        detectable, over, who = np.array([flags for _, *flags in now]).T
        wanted = together.need_bound.copy()
        earned, terms = together.of(records, detectable, over, who)
        for world, one in enumerate(apart):
            expected = (0.0, nothing())
            if who[world]:
                assert wanted[world] == one.need_bound[0]
                expected = of_one(one, now[world][0], detectable[world], over[world])
            told = {name: column[world] for name, column in terms.items()}
            assert (earned[world], told) == expected


def test_a_new_episode_begins_with_nothing_behind_it():
    rewards = Rewards(weights({"gain": 1.0}), 1)
    frame = Records.of([keyframe(in_view=True, detected=True)])
    yes = np.ones(1, bool)
    rewards.of(frame, yes, ~yes, yes)
    assert not rewards.need_bound
    rewards.begin(0)
    assert rewards.need_bound
    assert rewards.of(Records.of([keyframe(in_view=True)]), ~yes, ~yes, yes)[1]["delay"] == -1
