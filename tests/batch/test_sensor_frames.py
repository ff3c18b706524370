"""The sensors of many worlds stand and see as each of them does, to the last bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from care_sim.batch.state import BatchState, place_sensors, placed_by, seen_by, seen_by_each
from care_sim.core.frames import Frame

POSES = st.tuples(*[st.floats(-200, 200)] * 2, st.floats(-4, 4))
MOUNTS = st.tuples(*[st.floats(-2, 2)] * 3)
BOXES = st.tuples(
    *[st.floats(-50, 50)] * 2, st.floats(0, 3), *[st.floats(0.1, 9)] * 3, st.floats(-4, 4)
)


@given(st.lists(POSES, min_size=1, max_size=20), MOUNTS, BOXES, st.data())
def test_each_world_has_the_frame_of_its_own_sensor(poses, at, box, data):
    state = BatchState(len(poses))
    state.egos.bodies[:] = 1
    state.bodies.boxes[:, 1][:, [0, 1, 6]] = poses
    place_sensors(state, at)

    frames = [Frame.mounted(pose, at) for pose in poses]
    boxes = np.array([box])
    for world, frame in enumerate(frames):
        assert state.sensors.poses[world].tolist() == [frame.x, frame.y, frame.z, frame.yaw, 0, 0]
        seen, placed = frame.boxes_to_local(boxes), frame.boxes_to_world(boxes)
        assert seen_by(state.sensors, world, boxes).tobytes() == seen.tobytes()
        assert placed_by(state.sensors, world, boxes).tobytes() == placed.tobytes()

    worlds = data.draw(st.lists(st.sampled_from(range(len(poses))), unique=True))
    seen = seen_by_each(state.sensors, np.array(worlds, np.int64), np.repeat(boxes, len(worlds), 0))
    expected = [frames[world].boxes_to_local(boxes)[0].tolist() for world in worlds]
    assert seen.tolist() == expected
