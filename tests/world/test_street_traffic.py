"""The traffic of a street: lanes laid along roads, with the ego among the drivers."""

import numpy as np
import pytest

from care_sim.world.lane_flow import FlowingLane, LaneFlow, StreetTraffic


def along_x(places):
    return np.column_stack([places, np.zeros(len(places)), np.zeros(len(places))])


def lane(places, **ego):
    return FlowingLane(LaneFlow(places, [8.0] * len(places)), along_x, **ego)


def driven(street, seconds, ego_m, ego_speed=0.0):
    for _ in range(round(seconds / 0.05)):
        street.step(0.05, ego_m, ego_speed)
    return street.pose_at(0, 0, 0.0)[0]


def test_who_is_behind_a_standing_ego_stops():
    street = StreetTraffic([lane([-40.0], ego_from_m=-np.inf)])
    assert driven(street, 20.0, 0.0) == pytest.approx(-10.0, abs=1.0)


@pytest.mark.parametrize("ego_m", [9.0, 21.0])
def test_an_ego_that_is_in_another_lane_holds_nobody_up(ego_m):
    street = StreetTraffic([lane([-40.0], ego_from_m=10.0, ego_to_m=20.0)])
    assert driven(street, 10.0, ego_m) == pytest.approx(40.0)


def test_the_egos_place_in_a_lane_is_shifted():
    street = StreetTraffic([lane([-40.0], ego_from_m=0.0, ego_ahead_m=-100.0)])
    assert driven(street, 20.0, 100.0) == pytest.approx(-10.0, abs=1.0)


def test_poses_are_those_of_the_lane():
    street = StreetTraffic([lane([]), lane([3.0, 30.0])])
    street.step(0.05, 0.0, 0.0)
    assert street.pose_at(1, 0, 0.0) == (pytest.approx(3.4), 0.0, 0.0)
