"""Tracks along a route: what lies round a bend lies straight ahead."""

import numpy as np
import pytest

from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.types import Ego, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.driving.corridor import along_route, enters_strip, in_strip
from care_sim.world.route import Route

LEFT_TURN = Route(legs=((10.0, 0.0), (8.0 * np.pi / 2, 1 / 8.0)))
"""Ten metres ahead, then a quarter circle to the left, then along y at x = 18."""


def track(x, y, yaw=0.0, velocity=(0.0, 0.0)):
    row = [0, 4, x, y, 0.9, 0.7, 0.6, 1.8, yaw, *velocity, 0, 5]
    return Tracks.from_rows(np.array([row], float))


def test_on_a_straight_route_tracks_stay_as_they_are():
    sensor = Frame(3.0, 0.0, 1.84, 0.0)
    seen = track(12.0, -2.0, 0.3, (1.0, 2.0))
    laid = along_route(seen, Route(), sensor)
    assert laid.boxes == pytest.approx(seen.boxes)
    assert laid.velocities == pytest.approx(seen.velocities)


def test_a_person_beyond_the_bend_walks_across_the_way():
    sensor = Frame(0.0, 0.0, 1.84, 0.0)
    # At (20, 20), two metres to the right of the way that goes along y there, walking to the left.
    laid = along_route(track(20.0, 20.0, np.pi, (-1.5, 0.0)), LEFT_TURN, sensor)
    x, y, *_, yaw = laid.boxes[0]
    assert x == pytest.approx(10.0 + 4.0 * np.pi + 12.0)
    assert y == pytest.approx(-2.0)
    assert np.cos(yaw - np.pi / 2) == pytest.approx(1.0)
    assert laid.velocities[0] == pytest.approx([0.0, 1.5])


@pytest.mark.parametrize(
    ("place", "brakes"),
    [((16.9, 4.0), True), ((20.0, 0.0), False)],
    ids=["on the way round the bend", "straight ahead, where the car does not go"],
)
def test_the_controller_brakes_for_what_stands_on_the_way_alone(place, brakes):
    sensor = Frame(10.0, 0.0, 1.84, 0.0)
    seen = track(place[0] - 10.0, place[1])
    controller = BrakingController(8.0, 1.5, 0.9, 0.1, DriverSettings())
    assert controller.command(along_route(seen, LEFT_TURN, sensor), Ego(8.0)).braking == brakes
    straight_on = BrakingController(8.0, 1.5, 0.9, 0.1, DriverSettings())
    assert straight_on.command(seen, Ego(8.0)).braking != brakes


def test_no_tracks_stay_none():
    nobody = Tracks.from_rows(np.zeros((0, 13)))
    assert len(along_route(nobody, LEFT_TURN, Frame(0.0, 0.0, 1.84, 0.0))) == 0


def rows_of(*places):
    """Tracks 2 m long and 2 m wide from (x, y, sideways m/s)."""
    rows = [
        [n, 0, x, y, 0.9, 2.0, 2.0, 1.5, 0.0, 0.0, vy, 0, 5] for n, (x, y, vy) in enumerate(places)
    ]
    return Tracks.from_rows(np.array(rows, float))


def test_the_strip_reaches_from_the_bumper_on_and_to_either_side():
    """1.5 m ahead, 0.9 m to a side; a box that touches the side is in it, one that ends at the
    bumper is not.
    """
    inside = [(5.0, 1.9, 0.0), (5.0, -1.9, 0.0), (0.6, 0.0, 0.0)]
    outside = [(5.0, 1.91, 0.0), (5.0, -1.91, 0.0), (0.5, 0.0, 0.0)]
    assert in_strip(rows_of(*inside), 1.5, 0.9).all()
    assert not in_strip(rows_of(*outside), 1.5, 0.9).any()
    crossing = rows_of((5.0, 3.0, -1.0), (5.0, -3.0, 1.0), (5.0, 3.0, 1.0))
    assert not in_strip(crossing, 1.5, 0.9).any()
    assert enters_strip(crossing, 1.5, 0.9, 1.2).tolist() == [True, True, False]
