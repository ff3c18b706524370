import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.frames import Frame, turned

frames = st.builds(Frame, st.floats(-100, 100), st.floats(-100, 100), st.floats(0, 3), st.floats(-np.pi, np.pi))
tables = st.lists(st.tuples(*[st.floats(-50, 50)] * 7), max_size=4).map(lambda rows: np.array(rows).reshape(-1, 7))


def test_a_quarter_turn_takes_forward_to_left():
    assert turned(np.array([[1.0, 0.0, 5.0]]), np.pi / 2)[0] == pytest.approx([0, 1, 5])


def test_turning_leaves_its_input_alone():
    vectors = np.array([[1.0, 2.0]])
    turned(vectors, 1.0)
    assert vectors.tolist() == [[1.0, 2.0]]


def test_a_mount_turns_with_the_body():
    frame = Frame.mounted((10.0, 20.0, np.pi / 2), (2.0, 1.0, 1.5))
    assert (frame.x, frame.y, frame.z, frame.yaw) == pytest.approx((9, 22, 1.5, np.pi / 2))


def test_what_is_dead_ahead_of_a_turned_car():
    frame = Frame(10.0, 0.0, 2.0, np.pi / 2)
    (box,) = frame.boxes_to_local(np.array([[10.0, 7.0, 0.5, 4, 2, 1.5, np.pi]]))
    assert box == pytest.approx([7, 0, -1.5, 4, 2, 1.5, np.pi / 2])


@given(frames, tables)
def test_to_world_and_to_local_undo_each_other(frame, boxes):
    assert frame.boxes_to_local(frame.boxes_to_world(boxes)) == pytest.approx(boxes, abs=1e-9)
    assert frame.boxes_to_world(frame.boxes_to_local(boxes)) == pytest.approx(boxes, abs=1e-9)
