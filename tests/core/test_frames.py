import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from care_sim.core.frames import Frame, turned

frames = st.builds(
    Frame, st.floats(-100, 100), st.floats(-100, 100), st.floats(0, 3), st.floats(-np.pi, np.pi)
)
tilted = st.builds(
    Frame,
    *[st.floats(-100, 100)] * 3,
    yaw=st.floats(-np.pi, np.pi),
    roll=st.floats(-0.2, 0.2),
    pitch=st.floats(-0.2, 0.2),
)
tables = st.lists(st.tuples(*[st.floats(-50, 50)] * 7), max_size=4).map(
    lambda rows: np.array(rows).reshape(-1, 7)
)


def test_a_quarter_turn_takes_forward_to_left():
    assert turned(np.array([[1.0, 0.0, 5.0]]), np.pi / 2)[0] == pytest.approx([0, 1, 5])


def test_a_mount_turns_with_the_body():
    frame = Frame.mounted((10.0, 20.0, np.pi / 2), (2.0, 1.0, 1.5))
    assert (frame.x, frame.y, frame.z, frame.yaw) == pytest.approx((9, 22, 1.5, np.pi / 2))


def test_what_is_dead_ahead_of_a_turned_car():
    frame = Frame(10.0, 0.0, 2.0, np.pi / 2)
    (box,) = frame.boxes_to_local(np.array([[10.0, 7.0, 0.5, 4, 2, 1.5, np.pi]]))
    assert box == pytest.approx([7, 0, -1.5, 4, 2, 1.5, np.pi / 2])


@pytest.mark.filterwarnings("error")
@given(st.sampled_from([-1, 1]), st.floats(-3, 3), st.floats(-3, 3), st.floats(-1e-6, 1e-6))
def test_what_points_straight_up_or_down_is_turned_the_same(sign, yaw, roll, beside):
    rotation = Rotation.from_euler("ZYX", [yaw, sign * np.pi / 2 + beside, roll])
    frame = Frame.turned_by(rotation, np.zeros(3))
    assert frame.rotation.as_matrix() == pytest.approx(rotation.as_matrix(), abs=1e-6)


def test_pitch_lowers_the_front_and_roll_the_right():
    forward, left = np.eye(3)[0], np.eye(3)[1]
    assert Frame(0, 0, 0, 0, pitch=0.1).vectors_to_world(forward) == pytest.approx(
        [np.cos(0.1), 0, -np.sin(0.1)]
    )
    assert Frame(0, 0, 0, 0, roll=0.1).vectors_to_world(left) == pytest.approx(
        [0, np.cos(0.1), np.sin(0.1)]
    )
    assert Frame(0, 0, 0, np.pi / 2, pitch=0.1).vectors_to_world(forward)[1:] == pytest.approx(
        [np.cos(0.1), -np.sin(0.1)]
    )


@given(frames, tables)
def test_an_upright_frame_keeps_its_planar_arithmetic(frame, boxes):
    offset = np.array([frame.x, frame.y, frame.z, 0, 0, 0, frame.yaw])
    planar = boxes - offset
    planar[:, :3] = turned(planar[:, :3], -frame.yaw)
    assert np.array_equal(frame.boxes_to_local(boxes), planar)
    assert np.array_equal(frame.vectors_to_world(boxes[:, :3]), turned(boxes[:, :3], frame.yaw))


@given(tilted, tables)
def test_centres_go_through_a_tilted_frame_and_back_and_headings_nearly_so(frame, boxes):
    back = frame.boxes_to_world(frame.boxes_to_local(boxes))
    assert back[:, :6] == pytest.approx(boxes[:, :6], abs=1e-9)
    lost = np.angle(np.exp(1j * (back[:, 6] - boxes[:, 6])))
    assert np.all(np.abs(lost) <= frame.roll**2 + frame.pitch**2 + 1e-9)


@given(tilted, tables)
def test_a_tilted_frame_is_rigid(frame, boxes):
    points = frame.boxes_to_world(boxes)[:, :3]
    assert np.linalg.norm(points - frame.origin, axis=1) == pytest.approx(
        np.linalg.norm(boxes[:, :3], axis=1), abs=1e-9
    )
    assert frame.vectors_to_local(points - frame.origin) == pytest.approx(boxes[:, :3], abs=1e-9)


@given(tilted)
def test_a_box_on_a_tilted_axis_heads_where_the_axis_points(frame):
    """A box heading along the frame's own x axis heads, on the ground, along the frame's yaw."""
    (box,) = frame.boxes_to_world(np.array([[3.0, 0, 0, 4, 2, 1.5, 0.0]]))
    assert np.exp(1j * box[6]) == pytest.approx(np.exp(1j * frame.yaw))


@given(tilted, tilted)
def test_what_is_held_in_a_frame_moves_with_it(body, mount):
    held = body.holding(mount.origin, mount.rotation)
    point = np.array([1.0, 2.0, 3.0])
    through = body.origin + body.vectors_to_world(mount.origin + mount.vectors_to_world(point))
    assert held.origin + held.vectors_to_world(point) == pytest.approx(through, abs=1e-9)


@given(st.lists(st.tuples(*[st.floats(-100, 100)] * 7), max_size=4), st.floats(-7, 7))
def test_boxes_turn_as_vectors_do_to_the_last_bit(rows, yaw):
    """Compiled code turns boxes, NumPy vectors: published episodes hold both."""
    boxes = np.array(rows, float).reshape(-1, 7)
    frame = Frame(12.3, -4.5, 1.8, yaw)
    offset = np.array([12.3, -4.5, 1.8, 0, 0, 0, yaw])
    assert np.array_equal(frame.boxes_to_local(boxes), turned(boxes - offset, -yaw))
    assert np.array_equal(frame.boxes_to_world(boxes), turned(boxes, yaw) + offset)
