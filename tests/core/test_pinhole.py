import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.core.pinhole import NEAR_M, PinholeCamera, box_rays, mounted_cameras, window_around
from care_sim.sensors.surround import SURROUND_CAMERAS

cameras = st.builds(
    PinholeCamera,
    width=st.integers(32, 640),
    height=st.integers(32, 480),
    horizontal_fov=st.floats(0.3, 2.5),
    position=st.tuples(*[st.floats(-2, 2)] * 3),
    yaw=st.floats(-np.pi, np.pi),
    pitch=st.floats(-1, 1),
)


@pytest.mark.parametrize(
    ("point", "pixel"),
    [
        ((10, 0, 0), (160, 90)),
        ((10, 5, 0), (80, 90)),
        ((10, -10, 0), (320, 90)),
        ((20, 0, 5), (160, 50)),
    ],
)
def test_left_is_left_and_up_is_up_in_the_picture(point, pixel):
    pixels, depth = PinholeCamera().project([point])
    assert pixels[0] == pytest.approx(pixel)
    assert depth[0] == pytest.approx(point[0])


def test_yaw_turns_left_and_pitch_raises():
    left, _ = PinholeCamera(yaw=0.2).project([[np.cos(0.2), np.sin(0.2), 0.0]])
    raised, _ = PinholeCamera(pitch=0.2).project([[np.cos(0.2), 0.0, np.sin(0.2)]])
    assert left[0] == pytest.approx((160, 90))
    assert raised[0] == pytest.approx((160, 90))


def test_points_behind_have_no_pixel():
    pixels, depth = PinholeCamera().project([[-10.0, 0, 0], [0.0, 1, 0]])
    assert np.all(np.isnan(pixels))
    assert np.all(depth <= 0)


@given(cameras, st.floats(0, 1), st.floats(0, 1), st.floats(0.5, 100))
def test_rays_and_projection_undo_each_other(camera, across, down, scale):
    pixel = np.array([across * camera.width, down * camera.height])
    point = np.array(camera.position) + scale * camera.rays(pixel)
    pixels, depth = camera.project([point])
    assert pixels[0] == pytest.approx(
        pixel, abs=1e-6 * camera.width * (1 + camera.focal / camera.width)
    )
    assert depth[0] == pytest.approx(scale)


def test_box_rays_begin_with_the_centre_and_hold_the_corners():
    camera = PinholeCamera()
    rays = camera.box_rays([[10, 20, 30, 60]])
    pixels, _ = camera.project(rays[0])
    assert rays.shape == (1, 9, 3)
    assert pixels[0] == pytest.approx((20, 40))
    corners = {tuple(pixel) for pixel in np.round(pixels[1:], 6).tolist()}
    assert {(10, 20), (10, 60), (30, 20), (30, 60)} <= corners


boxes = st.tuples(
    *[st.floats(-30, 30)] * 2, st.floats(-3, 3), *[st.floats(0.2, 12)] * 3, st.floats(-3, 3)
).map(np.array)


@given(cameras, boxes)
def test_a_projected_box_is_the_tightest_around_what_lies_ahead_of_the_near_plane(camera, box):
    steps = np.linspace(-0.5, 0.5, 21)
    shares = np.array(np.meshgrid(steps, steps, steps)).reshape(3, -1).T
    local = shares * box[3:6]
    cos, sin = np.cos(box[6]), np.sin(box[6])
    points = box[:3] + np.stack(
        [cos * local[:, 0] - sin * local[:, 1], sin * local[:, 0] + cos * local[:, 1], local[:, 2]],
        -1,
    )
    pixels, depth = camera.project(points)
    (rectangle,) = camera.project_boxes(box[None])
    ahead = depth >= NEAR_M + 1e-9
    if not ahead.any():
        return
    slack = 1e-6 * (1 + np.abs(rectangle).max())
    assert np.all(pixels[ahead].min(axis=0) >= rectangle[:2] - slack)
    assert np.all(pixels[ahead].max(axis=0) <= rectangle[2:] + slack)
    if ahead.all():
        found = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
        assert found == pytest.approx(rectangle, rel=1e-6, abs=1e-4)


@given(cameras, st.lists(boxes, max_size=6))
def test_a_window_holds_what_boxes_span_those_beside_the_picture_left_out(camera, several):
    table = np.array(several).reshape(-1, 7)
    spans = camera.project_boxes(table)
    assert camera.window_on(table) == window_around(spans, camera.width, camera.height)


@pytest.mark.parametrize("side", [1, -1])
def test_the_tip_of_a_rod_beside_the_picture_is_in_the_window(side):
    """The rod ends two columns inside the edge of a picture 90 degrees wide, at a right angle to
    the plane through that edge, so that the ball about it ends there, too.
    """
    tip = 20.0 * np.array([160.0, side * 158.0]) / np.hypot(160.0, 158.0)
    heading = side * 0.75 * np.pi
    middle = tip + 5.0 * np.array([np.cos(heading), np.sin(heading)])
    rod = np.array([[*middle, 0.0, 10.0, 0.01, 0.01, heading]])
    left, _, right, _ = PinholeCamera().window_on(rod)
    assert (left, right) == ((0, 4) if side > 0 else (316, 320))


def test_roll_lowers_the_right_of_the_camera():
    """A camera that leans right sees the level horizon climb to its right."""
    camera = PinholeCamera(roll=0.1)
    (left, right), _ = camera.project([[10.0, 2.0, 0.0], [10.0, -2.0, 0.0]])
    assert left[1] > 90 > right[1]
    assert np.arctan2(left[1] - right[1], right[0] - left[0]) == pytest.approx(0.1)


@given(st.floats(-3, 3), st.floats(-1, 1), st.floats(-1, 1))
def test_the_axes_of_a_camera_are_those_of_the_frame_it_stands_in(yaw, pitch, roll):
    frame = Frame(0.0, 0.0, 0.0, yaw, roll=roll, pitch=-pitch)
    assert PinholeCamera(yaw=yaw, pitch=pitch, roll=roll).axes == pytest.approx(
        frame.rotation.as_matrix().T
    )


def test_several_cameras_at_once_see_what_each_sees_alone():
    boxes = np.array(
        [[10.0, 20, 30, 60], [100, 40, 300, 100], [0, 0, 320, 180], [160, 90, 200, 120]]
    )
    numbers = np.array([5, 0, 2, 0])
    rays = box_rays(boxes, numbers, mounted_cameras(1, SURROUND_CAMERAS))
    for row, number in enumerate(numbers):
        np.testing.assert_array_equal(rays[row], SURROUND_CAMERAS[number].box_rays(boxes[row])[0])


def test_a_camera_that_the_car_does_not_have_is_no_other():
    cameras = mounted_cameras(1, SURROUND_CAMERAS)
    with pytest.raises(IndexError):
        box_rays(np.array([[10.0, 20, 30, 60]]), np.array([6]), cameras)
