"""Lane keepers as columns go as highway-env moves them one by one, to the last bit."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_columns import SPEED, LaneColumns
from care_sim.world.traffic import Traffic

CAR, EGO = CATALOGUE["car"], CATALOGUE["ego"]
DT = 0.05
LANES = 3
PLACES = st.floats(-70.0, 70.0) | st.sampled_from([0.0, -22.5, -22.49])
SPEEDS = st.floats(0.0, 45.0) | st.floats(0.0, 14.0) | st.sampled_from([0.0, 8.0, 41.0])
DRIVERS = st.lists(st.tuples(PLACES, st.integers(0, LANES - 1), SPEEDS), max_size=5)
ROADS = st.tuples(
    SPEEDS,
    DRIVERS,
    st.sampled_from([1.8, 2.0, 3.5]),
    st.sampled_from([5.0, 14.0, 30.0]),
    st.lists(st.floats(-9.0, 4.0), min_size=1, max_size=5),
)


def road(speed, drivers, width, limit):
    """Some lanes are so narrow that highway-env takes a vehicle beside for one ahead."""
    traffic = Traffic((1,) * LANES, 0, width, limit)
    ego = traffic.add_ego(0.0, speed, EGO)
    return traffic, [ego, *(traffic.add_driver(x, lane, mps, CAR) for x, lane, mps in drivers)]


# Only one of two vehicles that are equally near ahead counts.
@example([(8.0, [(0.0, 0, 3.0), (-20.0, 0, 8.0)], 3.5, 14.0, [0.0])])
@settings(max_examples=60)
@given(st.lists(ROADS, min_size=1, max_size=4))
def test_columns_go_as_highway_env_moves_vehicles(roads):
    columns = LaneColumns(len(roads))
    made = [road(*given) for *given, _ in roads]
    for world, (traffic, vehicles) in enumerate(made):
        columns.begin(world, traffic.lane_keepers(vehicles, seconds=10.0))
    moved = np.ones(len(roads), np.bool_)
    for step in range(80):
        held = np.array([pedal[step % len(pedal)] for *_, pedal in roads])
        columns.step(moved, held, DT)
        for world, (traffic, vehicles) in enumerate(made):
            vehicles[0].accelerate(float(held[world]), DT)
            traffic.step(DT)
            expected = np.array([[vehicle.pose[0], vehicle.speed] for vehicle in vehicles])
            rows = columns.rows[world, : len(vehicles)]
            assert np.ascontiguousarray(rows[:, [0, SPEED]]).tobytes() == expected.tobytes()
            assert all(vehicle.pose[2] == 0.0 for vehicle in vehicles)


def out_of_order(traffic):
    return [traffic.add_driver(x, 0, 8.0, CAR) for x in (10.0, 10.0)][::-1]


def askew(traffic):
    driver = traffic.add_driver(10.0, 0, 8.0, CAR)
    driver._vehicle.heading = 1e-9
    return [driver]


@pytest.mark.parametrize(
    "others",
    [
        askew,
        out_of_order,
        lambda traffic: [traffic.add_driver(40.0, 1, 8.0, CAR)],  # oncoming
        lambda traffic: [traffic.add_parked_driver(20.0, 0, CAR, 8.0)],
        lambda traffic: [traffic.add_driver(700.0, 0, 8.0, CAR)],  # at the end
        lambda traffic: traffic.add_driver(20.0, 0, 8.0, CAR) and [],  # unknown
        lambda traffic: traffic.add_stop_line(50.0, 0) or [],
    ],
)
def test_what_is_not_sure_to_keep_its_lane_is_left_to_highway_env(others):
    traffic = Traffic((1, -1), 0, 3.5, 14.0)
    ego = traffic.add_ego(0.0, 8.0, EGO)
    assert traffic.lane_keepers([ego], 10.0) is not None
    assert traffic.lane_keepers([ego, *others(traffic)], 10.0) is None
