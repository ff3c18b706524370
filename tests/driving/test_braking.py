from itertools import pairwise

import numpy as np
import pytest

from care_sim.core.conditions import DriverSettings
from care_sim.core.types import Ego, Tracks
from care_sim.driving.braking import BrakingController

FRONT, HALF_WIDTH, KEYFRAME = 2.5, 0.9, 0.1
STOPPING_AT_10 = 10 * 0.3 + 10**2 / (2 * 5.0) + 2.0
"""Fifteen metres: reaction, braking, standstill distance."""
EDGE = HALF_WIDTH + 0.3 + 0.5
"""Where the centre of a 1 m wide object stands when its side touches the widened corridor."""


def controller(cruise=10.0, **rules):
    return BrakingController(cruise, FRONT, HALF_WIDTH, KEYFRAME, DriverSettings(**rules))


def objects(*rows, size=(2.0, 1.0, 1.5), yaw=0.0):
    """Tracks of `size` from (gap to the front bumper, y, vx, vy)."""
    table = [
        [n, 0, gap + FRONT + size[0] / 2, y, 0, *size, yaw, vx, vy, 0, 2]
        for n, (gap, y, vx, vy) in enumerate(rows)
    ]
    return Tracks.from_rows(np.array(table, dtype=float).reshape(-1, len(Tracks.COLUMNS)))


def brakes(*rows, speed=10.0, **kwargs):
    return controller().command(objects(*rows, **kwargs), Ego(speed)).braking


@pytest.mark.parametrize(
    ("gap", "expected"), [(STOPPING_AT_10 + 0.01, False), (STOPPING_AT_10 - 0.01, True)]
)
def test_brakes_at_the_stopping_distance_and_not_before(gap, expected):
    assert brakes((gap, 0, 0, 0)) is expected


@pytest.mark.parametrize("speed", [2.0, 5.0, 8.0])
def test_the_stopping_distance_grows_with_speed(speed):
    distance = speed * 0.3 + speed**2 / 10 + 2.0
    assert not brakes((distance + 0.01, 0, 0, 0), speed=speed)
    assert brakes((distance - 0.01, 0, 0, 0), speed=speed)


def drive(gap, speed=10.0, keyframes=60, obstacle_y=lambda _time: 0.0):
    """The ego's motion against one standing object, integrated keyframe by keyframe."""
    software, history, travelled = controller(cruise=speed), [], 0.0
    for index in range(keyframes):
        y = obstacle_y(index * KEYFRAME)
        command = software.command(objects((gap - travelled, y, 0, 0)), Ego(speed))
        history.append((gap - travelled, speed, command))
        slower = max(speed + command.acceleration * KEYFRAME, 0.0)
        travelled += (speed + slower) / 2 * KEYFRAME
        speed = slower
    return history


def test_an_approach_worked_by_hand():
    """Gaps 17.5, 16.5, 15.5, 14.5: the fourth is the first within 15 m. Three keyframes of
    reaction, then 10 m of braking: it stands 14.5 - 3 - 10 = 1.5 m before the object."""
    history = drive(17.5)
    assert [command.braking for _, _, command in history[:5]] == [False, False, False, True, True]
    assert [command.acceleration for _, _, command in history[3:8]] == [0.0, 0.0, 0.0, -5.0, -5.0]
    final_gap, final_speed, _ = history[-1]
    assert final_speed == 0.0
    assert final_gap == pytest.approx(1.5)


def test_once_braking_it_brakes_until_it_stands_and_stays():
    history = drive(17.5, keyframes=150)
    assert all(command.braking for _, _, command in history[3:])
    assert history[-1][1] == 0.0


@pytest.mark.parametrize("side", [1, -1])
def test_the_corridor_ends_at_its_margin(side):
    assert brakes((5, side * (EDGE - 0.01), 0, 0))
    assert not brakes((5, side * (EDGE + 0.01), 0, 0))


def test_a_turned_box_counts_with_its_turned_extent():
    """A quarter turn makes the 2 m length lie across: the box reaches half a metre further."""
    assert brakes((5, EDGE + 0.49, 0, 0), yaw=np.pi / 2)
    assert not brakes((5, EDGE + 0.51, 0, 0), yaw=np.pi / 2)


@pytest.mark.parametrize("side", [1, -1])
def test_an_entry_is_predicted_two_seconds_ahead(side):
    y = side * (EDGE + 2.0)
    assert brakes((5, y, 0, -side * 1.01))
    assert not brakes((5, y, 0, -side * 0.99))
    assert not brakes((5, y, 0, side * 5.0))


def test_one_who_crosses_the_whole_corridor_within_the_horizon_counts():
    assert brakes((5, 6.0, 0, -6.0))


def test_one_who_has_crossed_and_moves_away_does_not_count():
    assert not brakes((5, EDGE + 0.1, 0, 2.0))
    assert brakes((5, EDGE - 0.1, 0, 2.0))


def test_what_is_behind_the_bumper_does_not_count():
    assert not brakes((-2.01, 0, 0, 0))
    assert brakes((-1.99, 0, 0, 0))
    assert not brakes((-30, 0, 0, 0))


def test_a_car_driving_ahead_needs_way_to_stop_too():
    """Following at 10 m/s: 15 m less the 10 m of the car ahead."""
    assert not brakes((5.01, 0, 10, 0))
    assert brakes((4.99, 0, 10, 0))
    assert brakes((14.99, 0, -5, 0))


def test_of_many_the_one_that_counts_decides():
    assert brakes((40, 0, 0, 0), (5, 5, 0, 0), (10, 0, 0, 0))
    assert not brakes((40, 0, 0, 0), (5, 5, 0, 0))


def test_reaction_time_is_kept_to_the_keyframe():
    software = controller(brake_reaction_s=0.15)
    commands = [software.command(objects((5, 0, 0, 0)), Ego(10.0)) for _ in range(4)]
    assert [command.acceleration for command in commands] == [0.0, 0.0, -5.0, -5.0]
    assert all(command.braking for command in commands)


def test_the_brake_is_released_after_half_a_second_of_free_way():
    software = controller()
    for _ in range(5):
        software.command(objects((5, 0, 0, 0)), Ego(5.0))
    commands = [software.command(objects(), Ego(5.0)) for _ in range(6)]
    assert [command.braking for command in commands] == [True, True, True, True, False, False]
    assert commands[-1].acceleration == 1.5


def test_a_moment_of_free_way_starts_the_release_anew():
    software = controller()
    software.command(objects((5, 0, 0, 0)), Ego(5.0))
    for blocked in (False, False, False, False, True, False, False, False, False):
        rows = [(5, 0, 0, 0)] if blocked else []
        assert software.command(objects(*rows), Ego(5.0)).braking
    assert not software.command(objects(), Ego(5.0)).braking


def test_the_brake_is_released_behind_a_faster_car():
    software = controller()
    software.command(objects((3, 0, 5, 0)), Ego(10.0))
    assert software.command(objects((3, 0, 9, 0)), Ego(9.0)).braking
    commands = [software.command(objects((3, 0, 9.1, 0)), Ego(9.0)) for _ in range(5)]
    assert [command.braking for command in commands] == [True] * 4 + [False]


def test_the_brake_goes_on_and_off_once_for_one_who_crosses():
    history = drive(16.0, keyframes=120, obstacle_y=lambda time: 0.0 if time < 4.0 else 10.0)
    braking = [command.braking for _, _, command in history]
    changes = sum(before != after for before, after in pairwise(braking))
    assert changes == 2
    assert history[-1][1] == pytest.approx(10.0)


def test_a_free_road_holds_the_cruising_speed():
    software = controller(cruise=8.0)
    assert software.command(objects(), Ego(8.0)).acceleration == 0.0
    assert software.command(objects(), Ego(7.9)).acceleration == pytest.approx(1.0)
    assert software.command(objects(), Ego(2.0)).acceleration == 1.5
    assert software.command(objects(), Ego(9.0)).acceleration == -1.5


def test_at_standstill_it_waits_for_what_is_within_two_metres():
    assert brakes((1.99, 0, 0, 0), speed=0.0)
    assert not brakes((2.01, 0, 0, 0), speed=0.0)
