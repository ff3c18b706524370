"""The picture of a keyframe of either loop shows what happened, and taking it changes nothing."""

from dataclasses import replace
from itertools import pairwise

import gymnasium
import numpy as np
import pytest
from PIL import Image

import care_sim
from care_sim.core.grid import AngularGrid
from care_sim.viewer import palette
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.episode_view import episode_view
from care_sim.viewer.pictures.keyframe import (
    BELOW_SIZE,
    CELLS_SIZE,
    CELLS_TOP,
    PANEL_WIDTH,
    PICTURE_WIDTH,
    directions,
    draw_cells,
    draw_keyframe,
    draw_panel,
)
from care_sim.viewer.pictures.scene_view import MISSED_COLOUR, scene_view
from tests.helpers.lidars import CORNERS, STACK

HEIGHT = 720
SURROUND_HEIGHT = 860
"""Height of the picture of a rig with several cameras, whose row takes more room."""


def make(name, **arguments):
    env = gymnasium.make(name, disable_env_checker=True, **arguments)
    return env, care_sim.make_policy("care", env)


def shows(picture, colour, at_least=20):
    return np.all(picture == colour, axis=-1).sum() >= at_least


@pytest.fixture(params=["CARE-Dartout-v0", "CARE-Drive-v0", "CARE-R157-v0", "CARE-Replay-v0"])
def world(request, drive):
    """Name and arguments of an environment of either loop."""
    source = {"source": f"argoverse2:{drive}"} if request.param == "CARE-Replay-v0" else {}
    return request.param, source


def play(world, draw):
    """Observations and pictures of three keyframes, from before the first scan on."""
    name, source = world
    env, policy = make(name, render_mode="rgb_array" if draw else None, **source)
    # A seed with which the drive has somebody who hides, too.
    observation, _ = env.reset(seed=3)
    seen, pictures = [observation], [env.render()]
    for _ in range(3):
        observation, *_ = env.step(policy(observation))
        seen.append(observation)
        pictures.append(env.render())
    assert not draw or np.array_equal(env.render(), pictures[-1])
    env.close()
    return seen, pictures, len(env.unwrapped.rig.cameras)


def test_it_has_one_size_before_and_after_the_first_scan_and_changes_no_observation(world):
    seen, pictures, cameras = play(world, draw=True)
    film = world[0] == "CARE-Replay-v0"
    height = SURROUND_HEIGHT if cameras > 1 and not film else HEIGHT
    for picture in pictures:
        assert picture.shape == (height, PICTURE_WIDTH, 3)
        assert picture.dtype == np.uint8
    assert all(np.any(one != later) for one, later in pairwise(pictures))
    # Nothing hides the vehicle of a cut-in of UN Regulation 157.
    state = palette.IN_VIEW if "R157" in world[0] else palette.OUT_OF_VIEW
    assert shows(pictures[0], MISSED_COLOUR if film else state.colour)
    for plain, drawn in zip(play(world, draw=False)[0], seen, strict=True):
        assert all(np.array_equal(plain[key], drawn[key]) for key in plain)


@pytest.fixture(scope="module")
def dense():
    """The dense street at the first keyframe the person is detected and the car brakes."""
    env, policy = make("CARE-Dense-v0", render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    frame = None
    while frame is None or not (frame.detected and frame.braking):
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        assert not terminated
        assert not truncated
        frame = env.unwrapped.keyframes[-1]
    yield env.unwrapped
    env.close()


def test_it_says_what_happened(dense):
    picture = dense.render()
    assert shows(picture, palette.BRAKING_COLOUR, 1000)
    assert shows(picture, palette.DETECTED.colour, 50)
    assert shows(picture, palette.EXPLAINED_COLOUR, 500)
    frame = dense.keyframes[-1]
    calm = np.asarray(
        draw_keyframe(episode_view(dense.loop, [replace(frame, braking=False, detected=False)]))
    )
    assert not shows(calm, palette.BRAKING_COLOUR)
    assert not shows(calm, palette.DETECTED.colour)


def test_a_panel_of_either_loop_is_as_wide_and_has_an_even_height(dense, drive):
    """Film needs even sizes."""
    name, source = "CARE-Replay-v0", {"source": f"argoverse2:{drive}"}
    with gymnasium.make(name, disable_env_checker=True, **source) as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))
        inner = env.unwrapped
        panels = [
            draw_panel("care", scene_view(inner.loop, [inner.last])),
            draw_panel("care", episode_view(dense.loop, dense.keyframes)),
        ]
    for panel in panels:
        assert panel.width == PANEL_WIDTH
        assert panel.height % 2 == 0
        # The line at the bottom is as green as what is found.
        assert shows(np.asarray(panel)[-30:], palette.FOUND_COLOUR) == (panel is panels[1])


def test_the_grid_shows_the_left_on_the_left_and_colours_returns():
    grid = AngularGrid(columns=8, rows=2)
    ranges = np.zeros(grid.shape)
    left, right = 6, 1
    ranges[0, left] = grid.range_m
    ranges[1, right] = 10.0
    picture = np.asarray(drawing.cells_picture(drawing.scan_colours(grid, ranges), (8, 6)))
    assert picture.shape == (6, 8, 3)
    assert tuple(picture[0, 1]) == palette.NO_RETURN_COLOUR
    assert tuple(picture[5, 6]) == tuple(drawing.range_colours(np.array([0.2]))[0])
    assert tuple(picture[5, 1]) == palette.NOT_FIRED_COLOUR


@pytest.mark.parametrize("sensor", ["m1-forward", CORNERS])
def test_another_sensor_is_drawn_within_the_picture(sensor):
    """A camera wider than its place, a grid of other proportions than the paper's, and several."""
    with gymnasium.make("CARE-Dense-v0", sensor=sensor, render_mode="rgb_array") as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))
        picture = env.render()
    assert picture.shape == (HEIGHT, PICTURE_WIDTH, 3)
    # Between the camera's picture and the grid, and to the right of it, nothing is drawn.
    left, right = BELOW_SIZE[0], BELOW_SIZE[0] + CELLS_SIZE[0]
    for part in (slice(376, left), slice(right, None)):
        assert (picture[500 + CELLS_TOP : -50, part] == palette.BACKGROUND).all()


def test_several_lidars_are_drawn_one_below_the_other_within_the_room_of_one():
    """All cells of the third have returned; of the second none was fired."""
    canvas = Image.new("RGB", (CELLS_SIZE[0], 220), palette.BACKGROUND)
    ranges = np.zeros(STACK.shape)
    ranges[:8] = STACK.range_m
    ranges[12:] = 10.0
    end = draw_cells(canvas, (0, 0), STACK, drawing.scan_colours(STACK, ranges))
    colours = [tuple(pixel) for pixel in np.asarray(canvas)[CELLS_TOP:, 256]]
    near = tuple(drawing.range_colours(np.array([10 / 80]))[0])
    where = [colours.index(one) for one in (palette.NO_RETURN_COLOUR, near)]
    between = colours[where[0] : where[1]]
    assert palette.NOT_FIRED_COLOUR in between
    assert where[1] < CELLS_SIZE[1]
    assert end <= CELLS_TOP + CELLS_SIZE[1] + 26
    # One that goes all round names its ends, and the others what lies in their view.
    assert [name for _, name in directions(STACK.grids[1])] == ["left", "ahead"]
