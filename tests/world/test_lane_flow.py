"""The flow of a lane, held to highway-env's own drivers."""

import numpy as np
import pytest

from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_flow import STANDING_GAP_M, LaneFlow
from care_sim.world.traffic import Traffic

STEP = 0.05


def test_drivers_move_as_those_of_highway_env_do():
    places, speeds = [-60.0, -25.0, 30.0, 45.0], [8.3, 7.0, 6.0, 8.0]
    flow = LaneFlow(places, speeds)
    traffic = Traffic((1,), ego_lane=0, lane_width=3.5, speed_limit=20.0)
    ego = traffic.add_ego(0.0, 8.0, CATALOGUE["ego"])
    drivers = [
        traffic.add_driver(place, 0, speed, CATALOGUE["car"])
        for place, speed in zip(places, speeds, strict=True)
    ]
    for step in range(600):
        # The ego brakes to a stop and drives on: those behind it have to.
        x, speed = ego.pose[0], ego.speed
        ego.accelerate(-3.0 if 100 < step < 200 else 1.0 if speed < 8.0 else 0.0, STEP)
        traffic.step(STEP)
        flow.step(STEP, [(x, speed)])
        assert flow.places == pytest.approx([one.pose[0] for one in drivers], abs=1e-9)
        assert flow.speeds == pytest.approx([one.speed for one in drivers], abs=1e-9)
    assert flow.places[1] < ego.pose[0]


def test_the_first_driver_stops_before_what_stands():
    flow = LaneFlow([-80.0, -50.0], [7.0, 7.0])
    for _ in range(800):
        flow.step(STEP, [(STANDING_GAP_M, 0.0)])
    assert flow.places[1] == pytest.approx(0.0, abs=0.7)
    assert flow.places[0] == pytest.approx(-STANDING_GAP_M, abs=2.0)
    assert np.all(flow.speeds < 0.1)
