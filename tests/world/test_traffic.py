"""Road, ego and drivers of highway-env."""

import numpy as np
import pytest
from highway_env.road.lane import StraightLane
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from care_sim.world import lane_driver, traffic
from care_sim.world.bodies import CATALOGUE
from care_sim.world.traffic import Traffic

CAR, EGO = CATALOGUE["car"], CATALOGUE["ego"]
DT = 0.05


def drive(traffic, seconds, *watched, ego=None, acceleration=lambda time: 0.0):
    """Poses of the watched vehicles at every step, (steps, vehicles, 3)."""
    poses = []
    for step in range(round(seconds / DT)):
        if ego is not None:
            ego.accelerate(acceleration(step * DT), DT)
        traffic.step(DT)
        poses.append([vehicle.pose for vehicle in watched])
    return np.array(poses)


LANES = [(0, 0, 0.0), (0, 1, 3.5), (1, -1, -3.5), (1, 1, 3.5), (2, -2, -7.0)]


@pytest.mark.parametrize(("ego_lane", "lane", "y"), LANES)
def test_lanes_are_numbered_to_the_left_of_the_ego(ego_lane, lane, y):
    traffic = Traffic((1, 1, 1), ego_lane, 3.5, 14.0)
    assert traffic.add_driver(12.0, lane, 8.0, CAR).pose == pytest.approx((12.0, y, 0.0))


def test_an_oncoming_driver_faces_and_comes_towards_the_ego():
    traffic = Traffic((1, -1), 0, 3.5, 14.0)
    driver = traffic.add_driver(30.0, 1, 8.0, CAR)
    x, y, heading = driver.pose
    assert (x, y) == pytest.approx((30.0, 3.5))
    assert np.cos(heading) == pytest.approx(-1)
    poses = drive(traffic, 1.0, driver)
    assert poses[-1, 0, :2] == pytest.approx([22.0, 3.5], abs=0.1)


@pytest.mark.parametrize(("ego_lane", "start", "target"), [(1, -1, 0), (0, 0, 1), (0, 1, 0)])
def test_a_lane_change_ends_in_its_lane_and_turns_the_right_way(ego_lane, start, target):
    traffic = Traffic((1, 1), ego_lane, 3.5, 14.0)
    driver = traffic.add_parked_driver(20.0, start, CAR, 8.0)
    driver.pull_out(target)
    poses = drive(traffic, 12.0, driver)[:, 0]
    side = np.sign(target - start)
    assert poses[-1, 1] == pytest.approx(3.5 * target, abs=0.1)
    assert poses[-1, 2] == pytest.approx(0.0, abs=0.02)
    assert (side * poses[:, 2]).max() > 0.05
    assert (side * poses[:, 2]).min() > -0.05
    assert (side * np.diff(poses[:, 1])).min() > -0.01


def test_a_parked_driver_stands_until_told():
    traffic = Traffic((1, 1), 1, 3.5, 14.0)
    driver = traffic.add_parked_driver(20.0, -1, CAR, 8.0)
    assert np.ptp(drive(traffic, 2.0, driver)[:, 0], axis=0) == pytest.approx([0, 0, 0])
    driver.pull_out(0)
    drive(traffic, 4.0, driver)
    assert 3.0 < driver.speed <= 8.1


def test_a_follower_does_not_hit_a_braking_ego():
    traffic = Traffic((1, -1), 0, 3.5, 14.0)
    ego = traffic.add_ego(0.0, 8.0, EGO)
    follower = traffic.add_driver(-22.5, 0, 8.0, CAR)
    poses = drive(
        traffic, 8.0, ego, follower, ego=ego, acceleration=lambda time: 0.0 if time < 1 else -5.0
    )
    gaps = poses[:, 0, 0] - poses[:, 1, 0] - (EGO.size[0] + CAR.size[0]) / 2
    assert gaps.min() > 0.5
    assert ego.speed == pytest.approx(0.0, abs=1e-9)
    assert follower.speed < 2.0


def test_the_ego_stops_and_never_reverses():
    traffic = Traffic((1, -1), 0, 3.5, 14.0)
    ego = traffic.add_ego(0.0, 3.0, EGO)
    poses = drive(traffic, 3.0, ego, ego=ego, acceleration=lambda time: -5.0)
    assert np.all(np.diff(poses[:, 0, 0]) >= -1e-12)
    assert poses[-1, 0, 0] == pytest.approx(9 / 10, abs=0.1)
    assert ego.speed == pytest.approx(0.0, abs=1e-12)


def as_highway_env_drives(monkeypatch, run):
    """The result of `run` on the vehicles and lanes of highway-env itself."""
    with monkeypatch.context() as patch:
        patch.setattr(lane_driver, "LaneDriver", IDMVehicle)
        patch.setattr(lane_driver, "StraightVehicle", Vehicle)
        patch.setattr(lane_driver, "LaneAlongX", StraightLane)
        patch.setattr(traffic.RoadVehicle, "forget_lane", lambda vehicle: None)
        return run()


def test_who_is_faster_than_any_vehicle_goes_as_in_highway_env(monkeypatch):
    def run():
        road = Traffic((1,), 0, 3.5, 14.0)
        ego = road.add_ego(0.0, Vehicle.MAX_SPEED + 4.0, EGO)
        poses = drive(road, 1.0, ego, ego=ego, acceleration=lambda time: 2.0)
        return ego.speed, poses.tobytes()

    speed, poses = run()
    assert speed == pytest.approx(Vehicle.MAX_SPEED, abs=2.0)
    assert (speed, poses) == as_highway_env_drives(monkeypatch, run)


DIRECTIONS = (1, 1, -1, -1)
PLACES = st.floats(-60.0, 60.0)
LANES_THERE = st.integers(0, len(DIRECTIONS) - 1)
SPEEDS = st.floats(0.0, 16.0)
AT_THE_ENDS = st.sampled_from([994.0, -994.0, 999.0])
DRIVERS = st.tuples(
    PLACES | AT_THE_ENDS, LANES_THERE, SPEEDS, st.sampled_from([0.0, 0.0, 0.0, 0.02, -1e-9])
)
PULLING_OUT = st.tuples(PLACES, st.sampled_from([(0, 1), (1, 0), (2, 3), (3, 2)]), SPEEDS)


@settings(
    deadline=None, max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(DRIVERS, max_size=4),
    st.lists(PULLING_OUT, max_size=2),
    st.lists(st.tuples(PLACES, LANES_THERE), max_size=2),
    SPEEDS,
    st.lists(st.floats(-9.0, 3.0), min_size=1, max_size=6),
)
def test_random_traffic_goes_as_in_highway_env_to_the_last_bit(
    monkeypatch, drivers, pulling_out, stop_lines, speed, accelerations
):
    """Some overlap at the start, some are not along their lane, some are at rest or too fast."""

    def run():
        road = Traffic(DIRECTIONS, 0, 3.5, 14.0)
        ego = road.add_ego(0.0, speed, EGO)
        for x, lane in stop_lines:
            road.add_stop_line(x, lane)
        made = [road.add_driver(x, lane, mps, CAR) for x, lane, mps, _ in drivers]
        for driver, (*_, askew) in zip(made, drivers, strict=True):
            driver._vehicle.heading += askew
        for x, (start, target), mps in pulling_out:
            made.append(road.add_parked_driver(x, start, CAR, mps))
            made[-1].pull_out(target)
        motions = []
        for step in range(30):
            ego.accelerate(accelerations[step % len(accelerations)], DT)
            road.step(DT)
            motions += [[*one.pose, one.speed, one._vehicle.action["acceleration"]] for one in made]
        return np.array(motions)

    assert run().tobytes() == as_highway_env_drives(monkeypatch, run).tobytes()


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
