"""The drivers: the careful human of UN Regulation 157, and comfort before anything calls for the
brake.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions, DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.drivers import HUMAN_MODEL as HUMAN
from care_sim.driving.drivers import (
    CarefulHuman,
    Cruising,
    CruisingRules,
    brake_delay_s,
    check_driver,
)
from care_sim.world.route import Route, SpeedPlan

FRONT, HALF_WIDTH, KEYFRAME = 2.5, 0.9, 0.1
BESIDE = HALF_WIDTH + 1.0
"""Where the middle of a 2 m wide vehicle is when its side touches the ego's strip."""


def human():
    return CarefulHuman(20.0, FRONT, HALF_WIDTH, KEYFRAME, DriverSettings())


def vehicles(*rows, first=0):
    """Tracks 4 m long and 2 m wide from (gap to the front bumper, y, vx, vy)."""
    table = [
        [first + n, 0, gap + FRONT + 2.0, y, 0, 4.0, 2.0, 1.5, 0, vx, vy, 0, 2]
        for n, (gap, y, vx, vy) in enumerate(rows)
    ]
    return Tracks.from_rows(np.array(table, dtype=float).reshape(-1, len(Tracks.COLUMNS)))


def keyframes_to_braking(*row, speed=20.0):
    """Keyframes until the brake is on, for one vehicle that stays where it is."""
    driver = human()
    for number in range(40):
        if driver.command(vehicles(row), Ego(speed)).braking:
            return number
    return None


@pytest.mark.parametrize("side", [1, -1])
def test_a_cut_in_is_perceived_past_the_wandering_and_evaluated_for_four_keyframes(side):
    """3.5 - 0.375 m from the ego's middle; 0.4 s are four keyframes after the first."""
    assert keyframes_to_braking(10.0, side * 3.12, 10.0, -side * 1.0) == 4
    assert keyframes_to_braking(10.0, side * 3.13, 10.0, -side * 1.0) is None


def test_who_keeps_the_place_or_goes_away_does_not_cut_in():
    assert keyframes_to_braking(10.0, 3.0, 10.0, 0.0) is None
    assert keyframes_to_braking(10.0, 3.0, 10.0, -0.09) is None
    assert keyframes_to_braking(10.0, 3.0, 10.0, 1.0) is None


@pytest.mark.parametrize("side", [1, -1])
def test_what_is_in_the_way_is_a_risk_whatever_it_does(side):
    assert keyframes_to_braking(10.0, side * (BESIDE - 0.01), 10.0, 0.0) == 4
    assert keyframes_to_braking(10.0, side * (BESIDE + 0.01), 10.0, 0.0) is None


@pytest.mark.parametrize(("gap", "expected"), [(19.99, 4), (20.01, None)])
def test_a_risk_is_a_danger_within_two_seconds(gap, expected):
    """20 m at 10 m/s of closing speed."""
    assert keyframes_to_braking(gap, 0.0, 10.0, 0.0) == expected


def test_what_is_behind_the_bumper_or_as_fast_is_no_danger():
    assert keyframes_to_braking(-4.01, 0.0, 10.0, 0.0) is None
    assert keyframes_to_braking(-3.99, 0.0, 10.0, 0.0) == 4
    assert keyframes_to_braking(5.0, 0.0, 20.0, 0.0) is None
    assert keyframes_to_braking(-1.0, 0.0, 20.1, 0.0) is None


def test_an_interrupted_risk_is_evaluated_anew():
    driver = human()
    steady, cutting = (vehicles((10.0, 3.0, 10.0, vy)) for vy in (0.0, -1.0))
    seen = [*[cutting] * 4, steady, *[cutting] * 5]
    braking = [driver.command(tracks, Ego(20.0)).braking for tracks in seen]
    assert braking == [False] * 9 + [True]


def test_each_vehicle_is_evaluated_for_itself():
    driver = human()
    for first in range(8):
        assert not driver.command(vehicles((10.0, 0.0, 10.0, 0.0), first=first), Ego(20.0)).braking


def test_the_deceleration_loses_what_the_model_says():
    """Sums of the commands are the model's loss of speed at every keyframe."""
    driver = human()
    commands = [driver.command(vehicles((10.0, 0.0, 0.0, 0.0)), Ego(20.0)) for _ in range(24)]
    braking = [command.acceleration for command in commands[4:]]
    lost = -np.cumsum(braking) * KEYFRAME
    assert lost == pytest.approx(HUMAN.speed_lost(np.arange(1, 21) * KEYFRAME))
    assert braking[:7] == [0.0] * 7
    assert braking[-1] == pytest.approx(-HUMAN.brake_mps2)


def test_it_brakes_down_to_the_other_speed_holds_it_and_gains_speed_on_a_free_road():
    driver = human()
    slower = vehicles((10.0, 0.0, 10.0, 0.0))
    assert [driver.command(slower, Ego(20.0)).braking for _ in range(6)][-1]
    held = driver.command(slower, Ego(10.0))
    assert (held.braking, held.acceleration) == (False, 0.0)
    free = driver.command(vehicles(), Ego(10.0))
    assert (free.braking, free.acceleration) == (False, 1.5)
    assert driver.command(vehicles(), Ego(19.95)).acceleration == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"driver": "racer"}, "unknown driver 'racer'; known: careful-human, fixed"),
        (
            {"driver": "careful-human", "brake_mps2": 6.0},
            "brake_mps2 is of the driver fixed, careful-human does not know it",
        ),
    ],
)
def test_unknown_drivers_and_rules_that_are_not_theirs_are_refused(settings, line):
    with pytest.raises(InvalidInput, match=line):
        check_driver(ClosedLoopConditions(**settings))


def test_the_brake_acts_after_the_delay_of_the_driver():
    assert brake_delay_s(DriverSettings(brake_reaction_s=0.2)) == 0.2
    assert brake_delay_s(DriverSettings(driver="careful-human")) == 0.75


def test_the_numbers_are_those_of_table_1():
    """UN Regulation 157, Annex 3, Table 1; 12.65 m/s^3 is what 0.774 g in 0.6 s comes to."""
    assert (HUMAN.wander_m, HUMAN.evaluation_s, HUMAN.delay_s) == (0.375, 0.4, 0.75)
    assert (HUMAN.danger_s, HUMAN.jerk_s) == (2.0, 0.6)
    assert pytest.approx(7.59, abs=0.005) == HUMAN.brake_mps2
    assert pytest.approx(12.65, abs=0.005) == HUMAN.jerk_mps3


def test_the_braking_by_hand():
    """Nothing for 0.75 s, then half of 7.59 m/s^2 over 0.6 s, then all of it."""
    times = np.array([0.0, 0.75, 1.35, 2.35])
    ramp = HUMAN.brake_mps2 * 0.6 / 2
    assert HUMAN.speed_lost(times) == pytest.approx([0, 0, ramp, ramp + HUMAN.brake_mps2])
    saved = ramp * 0.6 / 3
    last = saved + ramp + HUMAN.brake_mps2 / 2
    assert HUMAN.distance_saved(times) == pytest.approx([0, 0, saved, last])


@given(st.floats(0.01, 40))
def test_the_time_to_lose_a_speed_undoes_the_speed_lost(speed):
    times = HUMAN.time_to_lose(np.array([speed]))
    assert HUMAN.speed_lost(times) == pytest.approx([speed])


CRUISE = 8.0
RULES = CruisingRules()
FREE = Command(1.5, False)


def tracks(*rows):
    """Cars at (x, y) with a velocity along the way, m/s."""
    count = len(rows)
    boxes = np.array([(x, y, 0.8, 4.6, 1.9, 1.7, 0.0) for x, y, _ in rows]).reshape(-1, 7)
    velocities = np.array([(vx, 0.0) for *_, vx in rows]).reshape(-1, 2)
    none = np.zeros(count, np.int64)
    return Tracks(np.arange(count), none, boxes, velocities, none, none + 2)


STRAIGHT = Route(legs=((300.0, 0.0),))


@cache
def cruising(route):
    return Cruising(SpeedPlan(route, CRUISE, 2.0, 1.5), FRONT, HALF_WIDTH, KEYFRAME)


def eased(*rows, speed=CRUISE, along=0.0, command=FREE, route=STRAIGHT):
    return cruising(route).eased(command, tracks(*rows), speed, along)


def test_a_bend_ahead_slows_the_car():
    bend = Route(legs=((30.0, 0.0), (12.0, 1 / 8.0), (30.0, 0.0)))
    speed, along = CRUISE, 0.0
    fastest = 0.0
    while along < 42.0:
        speed += eased(speed=speed, along=along, route=bend).acceleration * KEYFRAME
        along += speed * KEYFRAME
        fastest = max(fastest, speed**2 * abs(bend.curvature(along)))
    # 2 m/s^2 sideways, and a little more within the keyframe in which the bend begins.
    assert 1.9 < fastest < 2.2


def test_who_drives_ahead_is_followed_at_the_gap_of_the_model():
    gap, speed, lead = 40.0, CRUISE, 6.0
    for _ in range(900):
        ahead = FRONT + gap + 2.3
        speed += eased((ahead, 0.0, lead), speed=speed).acceleration * KEYFRAME
        gap += (lead - speed) * KEYFRAME
    # In equilibrium s = (s_0 + v T) / sqrt(1 - (v / v_0)^4).
    wanted = (2.0 + 6.0 * 1.5) / np.sqrt(1 - (6.0 / CRUISE) ** 4)
    assert speed == pytest.approx(lead, abs=0.01)
    assert gap == pytest.approx(wanted, abs=0.05)


@pytest.mark.parametrize(
    "other",
    [
        (12.0, 0.0, 0.0),
        (12.0, 3.5, 5.0),
        (-8.0, 0.0, 5.0),
        (2.0, 0.0, 5.0),
        (12.0, 0.0, -5.0),
    ],
    ids=["stands", "beside", "behind", "at the bumper", "oncoming"],
)
def test_only_who_drives_ahead_in_the_way_is_followed(other):
    assert eased(other) == eased()


def test_the_nearest_is_followed():
    near, far = (14.0, 0.0, 5.0), (30.0, 0.0, 2.0)
    assert eased(far, near) == eased(near)


def test_slowing_is_never_harder_than_comfortable():
    assert eased((FRONT + 2.5, 0.0, 1.0)).acceleration == -RULES.slowing_mps2
