"""Pictures tell of everybody whom the episode is about, and whom the car hit."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from PIL import Image, ImageDraw

import care_sim
from care_sim.loops.records import Sight
from care_sim.loops.watcher import sought
from care_sim.viewer.palette import DETECTED, HIT, IN_VIEW, OUT_OF_VIEW
from care_sim.viewer.pictures.episode_view import (
    CHASE_CAMERA,
    contact_text,
    episode_view,
    mark_actors,
)
from care_sim.viewer.pictures.keyframe import draw_keyframe
from care_sim.viewer.pictures.labels import Labels
from care_sim.world.approach import Impact

SEED = 105
"""A drive with three encounters, the first of them 43 m along the way, the second 89 m."""


@pytest.fixture(scope="module")
def drive():
    """The loop of a drive and its first keyframe."""
    env = gymnasium.make("CARE-Drive-v0", budget=0.01, disable_env_checker=True)
    observation, _ = env.reset(seed=SEED)
    env.step(care_sim.make_policy("care", env)(observation))
    yield env.unwrapped.loop, env.unwrapped.keyframes[-1]
    env.close()


def arrows(loop, frame):
    """The colours of states that the arrows have."""
    canvas = Image.new("RGB", (CHASE_CAMERA.width, CHASE_CAMERA.height))
    mark_actors(Labels(ImageDraw.Draw(canvas)), CHASE_CAMERA, loop, frame)
    drawn = {colour for _, colour in canvas.getcolors(2**20)}
    return {state for state in (DETECTED, HIT, IN_VIEW, OUT_OF_VIEW) if state.colour in drawn}


def test_an_arrow_tells_the_state_of_each_within_range(drive):
    loop, frame = drive
    unseen, found = Sight(40.0, False, False), Sight(40.0, False, True)
    assert arrows(loop, frame) == {OUT_OF_VIEW}
    assert arrows(loop, replace(frame, sights=(found, unseen, unseen))) == {DETECTED}
    # The second is 89 m away.
    assert arrows(loop, replace(frame, sights=(unseen, found, unseen))) == {OUT_OF_VIEW}


def test_whom_the_car_hit_is_named_whoever_it_is(drive):
    loop, frame = drive
    x, y, _ = loop.world.ego.pose
    others = [actor for actor in loop.world.actors if actor not in sought(loop.world)]
    cars = [actor for actor in others if actor.kind.name == "car"]
    near = min(cars, key=lambda actor: abs(actor.pose_at(0.0)[0] - x - 10) + abs(y))
    hit = replace(frame, impact=Impact(near.body, 5.04, True, "car", 5.04), impact_speed_mps=5.04)
    assert contact_text(loop, frame) is None
    assert contact_text(loop, hit) == f"HIT {near.name} at 5.0 m/s"
    assert arrows(loop, hit) == {OUT_OF_VIEW, HIT}
    into_the_car = replace(hit, impact=Impact(near.body, 5.04, False, "car", 5.04))
    assert contact_text(loop, into_the_car) == f"HIT BY {near.name}"
    header = np.asarray(draw_keyframe(episode_view(loop, [replace(hit, braking=False)])))[:40]
    # A plate as large as its words.
    assert np.all(header == HIT.colour, axis=-1).sum() > 4000
