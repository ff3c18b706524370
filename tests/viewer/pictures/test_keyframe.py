"""The picture of a keyframe: it shows what happened, and taking it changes nothing."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from PIL import Image

import care_sim
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.envs import CLOSED_LOOP
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.camera_views import EXPLAINED_COLOUR
from care_sim.viewer.pictures.comparison import draw_panel
from care_sim.viewer.pictures.keyframe import (
    BRAKING_COLOUR,
    GRID_LEFT,
    PANELS_TOP,
    PICTURE_HEIGHT,
    PICTURE_WIDTH,
    SURROUND_HEIGHT,
    directions,
    draw_grid,
    draw_keyframe,
)
from care_sim.viewer.pictures.sought import DETECTED, IN_VIEW, OUT_OF_VIEW
from tests.helpers.lidars import CORNERS, STACK


def make(name, **arguments):
    env = gymnasium.make(name, disable_env_checker=True, **arguments)
    return env, care_sim.make_policy("care", env)


def shows(picture, colour, at_least=20):
    return np.all(picture == colour, axis=-1).sum() >= at_least


def play(name, keyframes, *, draw):
    env, policy = make(name, render_mode="rgb_array" if draw else None)
    observation, _ = env.reset(seed=0)
    seen = [observation]
    for _ in range(keyframes):
        if draw:
            env.render()
        observation, *_ = env.step(policy(observation))
        seen.append(observation)
    env.close()
    return seen


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
    yield env
    env.close()


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_it_has_one_size_before_and_after_the_first_scan(name):
    env, policy = make(name, render_mode="rgb_array")
    # A seed with which the drive has somebody who hides, too.
    observation, _ = env.reset(seed=3)
    before = env.render()
    env.step(policy(observation))
    after = env.render()
    env.close()
    height = SURROUND_HEIGHT if len(env.unwrapped.rig.cameras) > 1 else PICTURE_HEIGHT
    for picture in (before, after):
        assert picture.shape == (height, PICTURE_WIDTH, 3)
        assert picture.dtype == np.uint8
    assert np.any(before != after)
    # Nothing hides the vehicle of a cut-in of UN Regulation 157.
    assert shows(before, IN_VIEW.colour if "R157" in name else OUT_OF_VIEW.colour)


def test_rendering_changes_no_observation():
    for plain, drawn in zip(
        play("CARE-Dense-v0", 6, draw=False), play("CARE-Dense-v0", 6, draw=True), strict=True
    ):
        assert all(np.array_equal(plain[key], drawn[key]) for key in plain)


def test_the_same_keyframe_gives_the_same_picture(dense):
    assert np.array_equal(dense.render(), dense.render())


def test_it_says_what_happened(dense):
    picture = dense.render()
    assert shows(picture, BRAKING_COLOUR, 1000)
    assert shows(picture, DETECTED.colour, 50)
    assert shows(picture, EXPLAINED_COLOUR, 500)
    loop = dense.unwrapped.loop
    frame = dense.unwrapped.keyframes[-1]
    calm = draw_keyframe(loop, replace(frame, braking=False, detected=False))
    assert not shows(calm, BRAKING_COLOUR)
    assert not shows(calm, DETECTED.colour)


def test_the_grid_shows_the_left_on_the_left_and_colours_returns():
    grid = AngularGrid(columns=8, rows=2)
    ranges = np.zeros(grid.shape)
    left, right = 6, 1
    ranges[0, left] = grid.range_m
    ranges[1, right] = 10.0
    picture = np.asarray(drawing.fitted(drawing.grid_picture(grid, ranges), (8, 6)))
    assert picture.shape == (6, 8, 3)
    assert tuple(picture[0, 1]) == drawing.NO_RETURN_COLOUR
    assert tuple(picture[5, 6]) == tuple(drawing.range_colours(np.array([0.2]))[0])
    assert tuple(picture[5, 1]) == drawing.NOT_FIRED_COLOUR


def test_points_behind_the_camera_are_not_marked():
    camera = PinholeCamera(100, 50)
    assert drawing.point_above(camera, np.array([5.0, 0, 0, 1, 1, 1, 0])) is not None
    assert drawing.point_above(camera, np.array([-5.0, 0, 0, 1, 1, 1, 0])) is None


def test_a_picture_of_more_cells_than_pixels_averages_them():
    grid = AngularGrid(columns=4, rows=2)
    ranges = np.zeros(grid.shape)
    ranges[:, :2] = grid.range_m
    picture = np.asarray(drawing.fitted(drawing.grid_picture(grid, ranges), (2, 4)))
    assert [tuple(pixel) for pixel in picture[0]] == [
        drawing.NOT_FIRED_COLOUR,
        drawing.NO_RETURN_COLOUR,
    ]
    assert (picture == picture[0]).all()


def test_a_setting_with_another_sensor_is_drawn_within_the_picture():
    """A camera wider than its place, and a grid of other proportions than the paper's."""
    with gymnasium.make("CARE-Dense-v0", sensor="m1-forward", render_mode="rgb_array") as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))
        picture = env.render()
        panel = draw_panel("care", env.unwrapped.loop, env.unwrapped.keyframes)
    assert picture.shape == (PICTURE_HEIGHT, PICTURE_WIDTH, 3)
    # Between the camera's picture and the grid, and to the right of it, nothing is drawn.
    background = np.array(drawing.BACKGROUND)
    assert (picture[PANELS_TOP + 44 : -30, 376 : GRID_LEFT - 2] == background).all()
    assert (picture[PANELS_TOP + 44 : -30, GRID_LEFT + 514 :] == background).all()
    assert panel.size == (512, 508)


def test_several_lidars_are_drawn_one_below_the_other_within_the_room_of_one():
    """All cells of the third have returned; of the second none was fired."""
    canvas = Image.new("RGB", (PICTURE_WIDTH, PICTURE_HEIGHT), drawing.BACKGROUND)
    ranges = np.zeros(STACK.shape)
    ranges[:8] = STACK.range_m
    ranges[12:] = 10.0
    draw_grid(canvas, (GRID_LEFT, PANELS_TOP), STACK, ranges)
    picture = np.asarray(canvas)
    assert (picture[:, : GRID_LEFT - 2] == drawing.BACKGROUND).all()
    colours = [tuple(pixel) for pixel in picture[PANELS_TOP + 44 :, GRID_LEFT + 256]]
    near = tuple(drawing.range_colours(np.array([10 / 80]))[0])
    where = [colours.index(one) for one in (drawing.NO_RETURN_COLOUR, near)]
    between = colours[where[0] : where[1]]
    assert drawing.NOT_FIRED_COLOUR in between
    assert where[1] < 128
    # One that goes all round names its ends, and the others what lies in their view.
    assert [name for _, name in directions(STACK.grids[1])] == ["left", "ahead"]


def test_a_panel_of_several_lidars_shows_what_each_has_ahead():
    with gymnasium.make("CARE-Dense-v0", sensor=CORNERS, budget=1.0) as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))
        panel = draw_panel("care", env.unwrapped.loop, env.unwrapped.keyframes)
    # Four pixels of background lie between two of them.
    column = [tuple(pixel) for pixel in np.asarray(panel)[378:474, 300]]
    assert panel.size == (512, 508)
    assert column.count((0, 0, 0)) + column.count(drawing.BACKGROUND) == 8


@pytest.mark.parametrize("heading", [-np.pi, np.pi])
def test_a_grid_that_looks_behind_names_every_direction(heading):
    named = directions(AngularGrid(heading=heading))
    assert sorted(named) == [
        (0.0, "ahead"), (0.25, "right"), (0.5, "behind"), (0.75, "left"), (1.0, "ahead"),
    ]  # fmt: skip
