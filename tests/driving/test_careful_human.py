import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions, DriverSettings
from care_sim.core.types import Ego, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.driving.drivers import HUMAN_MODEL as HUMAN
from care_sim.driving.drivers import CarefulHuman, brake_delay_s, check_driver, make_driver

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


def test_drivers_by_name():
    made = [
        make_driver(DriverSettings(driver=name), 10.0, FRONT, HALF_WIDTH, KEYFRAME)
        for name in ("fixed", "careful-human")
    ]
    assert [type(driver) for driver in made] == [BrakingController, CarefulHuman]
    assert [driver.guarded_m for driver in made] == pytest.approx([2.4, 1.8])


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


def test_comfort_is_of_both_drivers():
    check_driver(DriverSettings(driver="careful-human", comfort_mps2=2.0))
    check_driver(DriverSettings(brake_mps2=6.0, comfort_mps2=2.0))


def test_the_brake_acts_after_the_delay_of_the_driver():
    assert brake_delay_s(DriverSettings(brake_reaction_s=0.2)) == 0.2
    assert brake_delay_s(DriverSettings(driver="careful-human")) == 0.75
