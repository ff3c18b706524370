"""Drivers of a lane, and of a street."""

import numpy as np
import pytest

from care_sim.world.bodies import CATALOGUE
from care_sim.world.lane_flow import (
    STANDING_GAP_M,
    Crossing,
    FlowingLane,
    LaneFlow,
    StreetTraffic,
)
from care_sim.world.motions import Crosser, Walk
from care_sim.world.traffic import Traffic

STEP = 0.05


def test_drivers_move_as_those_of_highway_env_do():
    places, speeds = [-60.0, -25.0, 30.0, 45.0], [8.3, 7.0, 6.0, 8.0]
    flow = LaneFlow(places, speeds, [0] * 4)
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
        flow.step(STEP, [(x, speed, 0), (x - 5.0, 0.0, 1)])
        assert flow.places == pytest.approx([one.pose[0] for one in drivers], abs=1e-9)
        assert flow.speeds == pytest.approx([one.speed for one in drivers], abs=1e-9)
        # The car behind never comes nearer than the standing gap, less what the model overshoots.
        assert ego.pose[0] - flow.places[1] > STANDING_GAP_M - 1.0
        assert np.diff(flow.places)[[0, 2]].min() > STANDING_GAP_M


def test_the_first_driver_stops_before_what_stands():
    flow = LaneFlow([-80.0, -50.0], [7.0, 7.0], [0, 0])
    for _ in range(800):
        flow.step(STEP, [(STANDING_GAP_M, 0.0, 0)])
    assert flow.places[1] == pytest.approx(0.0, abs=0.7)
    assert flow.places[0] == pytest.approx(-STANDING_GAP_M, abs=2.0)
    assert np.all(flow.speeds < 0.1)


def along_x(places):
    return np.stack([places, 0 * places, 0 * places], axis=-1)


def lane(places, **ego):
    return FlowingLane(places, [8.0] * len(places), **ego)


def street_of(*lanes):
    return StreetTraffic(lanes, along_x)


def driven(street, seconds, ego_m, ego_speed=0.0):
    for step in range(1, round(seconds / STEP) + 1):
        street.step(STEP, step * STEP, ego_m, ego_speed)
    return street.poses_at(0.0)[0, 0]


def test_who_is_behind_a_standing_ego_stops():
    street = street_of(lane([-40.0], ego_from_m=-np.inf))
    assert driven(street, 20.0, 0.0) == pytest.approx(-10.0, abs=1.0)


def test_the_egos_place_in_a_lane_is_shifted():
    street = street_of(lane([-40.0], ego_from_m=0.0, ego_ahead_m=-100.0))
    assert driven(street, 20.0, 100.0) == pytest.approx(-10.0, abs=1.0)


def test_poses_are_those_of_the_lane():
    street = street_of(lane([]), lane([3.0, 30.0]))
    street.step(STEP, STEP, 0.0, 0.0)
    assert street.poses_at(0.0)[0].tolist() == [pytest.approx(3.4), 0.0, 0.0]


def crossing(from_m, to_m, went=True):
    """Over x = 0 goes somebody at 1 m/s, from the start on: `went` is what they decided."""
    crosser = Crosser(Walk((0.0, -30.0), np.pi / 2, 1.0, 1e6, 60.0), 0.0, lambda _: went)
    crosser.look(0.0, lambda: 0.0)
    return Crossing(crosser, 0.0, from_m, to_m)


@pytest.mark.parametrize(
    ("crossings", "place"),
    [
        # On the lane from 5 s on: 40 m are driven in them.
        ([crossing(5.0, np.inf)], -STANDING_GAP_M),
        ([crossing(5.0, 30.0)], None),
        ([crossing(20.0, np.inf)], 60.0),
        ([crossing(5.0, np.inf, went=False)], 60.0),
        ([], 60.0),
    ],
)
def test_drivers_stop_before_who_crosses_until_they_are_over(crossings, place):
    street = street_of(lane([-100.0], crossings=crossings))
    reached = driven(street, 20.0, 0.0)
    assert reached == pytest.approx(place, abs=1.0) if place else reached < -STANDING_GAP_M + 1.0
    # Somebody who is over the lane holds nobody up.
    for step in range(401, 1201):
        street.step(STEP, step * STEP, 0.0, 0.0)
    assert (street.poses_at(0.0)[0, 0] > 50.0) == (place != -STANDING_GAP_M)


def test_who_has_passed_a_crossing_drives_on():
    street = street_of(lane([-3.9], crossings=[crossing(0.5, np.inf)]))
    assert driven(street, 10.0, 0.0) == pytest.approx(76.1)


def test_places_are_foreseen_before_the_stop_line_without_ego_and_crossers():
    foreseen = street_of(lane([-40.0], stop_m=0.0)).foreseen(300, STEP)
    flow = LaneFlow([-40.0], [8.0], [0])
    for row in foreseen:
        assert row[:, 0] == flow.places
        flow.step(STEP, [(0.0, 0.0, 0)])
    alone = lane([-40.0], crossings=[crossing(0.0, np.inf)], ego_from_m=-np.inf, ego_to_m=np.inf)
    free = street_of(lane([-35.0]), alone)
    assert free.foreseen(2, STEP)[:, 1, 0].tolist() == [-40.0, pytest.approx(-39.6)]
    assert free.flow.places.tolist() == [-35.0, -40.0]
