import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.world.motions import LaneChange


@pytest.mark.parametrize("side", [1, -1])
def test_a_change_by_hand(side):
    """10 m/s along; from 2 s on 1.5 m/s across, until 3.5 m are done after 2.33 s."""
    change = LaneChange((5.0, side * 3.5), 10.0, begins_s=2.0, lateral_mps=1.5, to_y=0.0)
    places = {0.0: (5.0, 3.5), 2.0: (25.0, 3.5), 3.0: (35.0, 2.0), 4.0: (45.0, 0.5), 5.0: (55.0, 0)}
    for time, (x, y) in places.items():
        assert change.pose(time) == pytest.approx((x, side * y, 0.0))


@given(
    st.builds(
        LaneChange,
        st.tuples(st.floats(-90, 90), st.floats(-9, 9)),
        *(st.floats(0, 30), st.floats(-2, 9), st.floats(0.1, 3), st.floats(-9, 9)),
    ),
    st.lists(st.floats(-1, 60), max_size=50),
)
def test_all_poses_at_once_are_those_one_by_one(change, times):
    each = np.array([change.pose(time) for time in times]).reshape(-1, 3)
    assert change.poses(np.array(times)).tobytes() == each.tobytes()
