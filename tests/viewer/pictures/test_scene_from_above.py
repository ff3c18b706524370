"""The picture of the open loop: it shows what was found, and taking it changes nothing."""

from itertools import pairwise

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.viewer.pictures.keyframe import PICTURE_HEIGHT, PICTURE_WIDTH
from care_sim.viewer.pictures.scene_from_above import FOUND_COLOUR, MISSED_COLOUR, RETURN_COLOUR

STEPS_OUT = 5
"""The keyframe at which the person of the drive appears."""


@pytest.fixture
def play(drive):
    """Plays the drive: its pictures, from before the first scan on, and its observations."""

    def make(policy, budget=1.0, draw=True, keyframes=10):
        mode = "rgb_array" if draw else None
        env = gymnasium.make(
            "CARE-Replay-v0",
            disable_env_checker=True,
            source=f"argoverse2:{drive}",
            budget=budget,
            render_mode=mode,
        )
        chooses = care_sim.make_policy(policy, env)
        observation, _ = env.reset(seed=0)
        pictures = [env.render()]
        observations = [observation]
        for _ in range(keyframes):
            observation, *_ = env.step(chooses(observation))
            pictures.append(env.render())
            observations.append(observation)
        return pictures, observations

    return make


def count(picture, colour):
    """Pixels of a colour on the map: the legend is below."""
    return int(np.all(picture[:500] == colour, axis=-1).sum())


def test_there_is_a_picture_before_the_first_scan_and_after_the_last(play):
    pictures, _ = play("full")
    assert len(pictures) == 11
    assert all(
        picture.shape == (PICTURE_HEIGHT, PICTURE_WIDTH, 3) and picture.dtype == np.uint8
        for picture in pictures
    )
    assert all(np.any(one != next_) for one, next_ in pairwise(pictures))


def test_what_fired_decides_what_is_drawn_as_found(play):
    before, scanned = play("full", keyframes=1)[0]
    assert count(before, FOUND_COLOUR) == count(before, RETURN_COLOUR) == 0
    assert count(before, MISSED_COLOUR) > 50
    assert count(scanned, FOUND_COLOUR) > 50
    assert count(scanned, RETURN_COLOUR) > 500
    _, starved = play("random", budget=1e-4, keyframes=1)[0]
    assert count(starved, FOUND_COLOUR) == 0
    assert count(starved, RETURN_COLOUR) <= 2


def test_a_first_sighting_has_a_second_line_at_its_keyframe_alone(play):
    pictures, _ = play("full", keyframes=STEPS_OUT + 2)
    drawn = [
        count(picture, FOUND_COLOUR) + count(picture, MISSED_COLOUR) for picture in pictures[1:]
    ]
    assert drawn[STEPS_OUT] > drawn[STEPS_OUT + 1] + 10
    assert drawn[STEPS_OUT] > drawn[STEPS_OUT - 1]


def test_rendering_changes_no_observation(play):
    for plain, drawn in zip(play("care", 0.1, draw=False)[1], play("care", 0.1)[1], strict=True):
        assert all(np.array_equal(plain[key], drawn[key]) for key in plain)
