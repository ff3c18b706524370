import pytest

from care_sim.world.bodies import CATALOGUE
from care_sim.world.traffic import Traffic


@pytest.mark.parametrize(("lane", "start", "line"), [(0, -60.0, 0.0), (1, 70.0, 10.0)])
def test_a_driver_comes_to_rest_before_the_line(lane, start, line):
    traffic = Traffic((1, -1), 0, 3.5, 8.0)
    driver = traffic.add_driver(start, lane, 8.0, CATALOGUE["car"])
    traffic.add_stop_line(line, lane)
    for _ in range(400):
        traffic.step(0.1)
    assert driver.speed < 0.3
    assert abs(driver.pose[0] - line) < 2.0
    assert (driver.pose[0] - line) * (line - start) <= 0.1


def test_the_line_of_one_lane_does_not_hold_the_other():
    traffic = Traffic((1, -1), 0, 3.5, 8.0)
    driver = traffic.add_driver(-30.0, 0, 8.0, CATALOGUE["car"])
    traffic.add_stop_line(0.0, 1)
    for _ in range(100):
        traffic.step(0.1)
    assert driver.pose[0] == pytest.approx(50.0, abs=1.0)
