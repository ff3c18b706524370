import pytest

from care_sim.world.lane_change import LaneChange


@pytest.mark.parametrize("side", [1, -1])
def test_a_change_by_hand(side):
    """10 m/s along; from 2 s on 1.5 m/s across, until 3.5 m are done after 2.33 s."""
    change = LaneChange((5.0, side * 3.5), 10.0, begins_s=2.0, lateral_mps=1.5, to_y=0.0)
    places = {0.0: (5.0, 3.5), 2.0: (25.0, 3.5), 3.0: (35.0, 2.0), 4.0: (45.0, 0.5), 5.0: (55.0, 0)}
    for time, (x, y) in places.items():
        assert change.pose(time) == pytest.approx((x, side * y, 0.0))
