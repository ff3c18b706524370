"""The row of several cameras: each picture where its camera looks, with its own detections."""

import gymnasium
import numpy as np
import pytest

from care_sim.sensors.annotated import NO_OBJECT
from care_sim.viewer.palette import EXPLAINED_COLOUR, FALSE_COLOUR, UNEXPLAINED_COLOUR
from care_sim.viewer.pictures.episode_view import PICTURES_TOP, cameras_picture
from care_sim.viewer.pictures.furnished_world import furnished
from care_sim.viewer.pictures.keyframe import PICTURE_WIDTH

FROM_LEFT = (5, 3, 1, 0, 2, 4)
"""The cameras of the ring: back, back left, front left, front, front right, back right."""


@pytest.fixture(scope="module")
def loop():
    env = gymnasium.make("CARE-Drive-v0", disable_env_checker=True)
    env.reset(seed=100)
    yield env.unwrapped.loop
    env.close()


@pytest.fixture(scope="module")
def pictures(loop):
    with furnished(loop.world) as scene:
        row = np.asarray(cameras_picture(scene, loop))[PICTURES_TOP : PICTURES_TOP + 90]
    assert row.shape == (90, PICTURE_WIDTH, 3)
    return np.split(row, len(loop.rig.cameras), axis=1)


def test_they_come_as_the_columns_of_the_grid_do_and_show_their_own_boxes(loop, pictures):
    seen = loop.belief.detections
    # Before the first scan there is no track to explain any.
    assert len(seen) > 20
    for picture, number in zip(pictures, FROM_LEFT, strict=True):
        # The left edge of every box, at half of the camera's size.
        for left, top, _, bottom in (seen.boxes[seen.cameras == number] / 2).tolist():
            column = min(round(left), 159)
            edge = picture[int(top) : int(bottom) + 1, max(column - 1, 0) : column + 2]
            assert np.any(np.all(edge == UNEXPLAINED_COLOUR, axis=-1))
        assert not np.any(np.all(picture == EXPLAINED_COLOUR, axis=-1))


def test_a_false_box_has_a_colour_of_its_own_and_a_cross(pictures):
    with gymnasium.make("CARE-Dense-v0", disable_env_checker=True, false_positive_rate=3.0) as env:
        env.reset(seed=0)
        own = env.unwrapped.loop
        false = own.detected_bodies == NO_OBJECT
        assert 0 < false.sum() < len(false)
        with furnished(own.world) as scene:
            picture = np.asarray(cameras_picture(scene, own))[PICTURES_TOP:, 20:]
    # The picture is 320 x 180 pixels.
    scale = 320 / own.rig.cameras[0].width
    shown = np.all(picture == FALSE_COLOUR, axis=-1)
    for box in scale * own.belief.detections.boxes[false]:
        left, top, right, bottom = np.clip(box.round().astype(int), 0, None)
        assert shown[top : bottom + 1, left : right + 1].sum() >= bottom - top
    assert not any(np.any(np.all(each == FALSE_COLOUR, axis=-1)) for each in pictures)
