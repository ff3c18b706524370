"""Tracks along a route: what lies round a bend lies straight ahead."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.types import Ego, Tracks
from care_sim.driving.corridor import along_route, enters_strip, leaves_s
from care_sim.world.route import Route
from tests.helpers.brake import Brake

FRONT, HALF_WIDTH, KEYFRAME = 2.5, 0.9, 0.1
EDGE = HALF_WIDTH + 0.3 + 0.5
"""Where the centre of a 1 m wide object stands when its side touches the widened corridor."""


def controller(cruise=10.0, **rules):
    return Brake(cruise, FRONT, HALF_WIDTH, KEYFRAME, DriverSettings(**rules))


def objects(*rows, size=(2.0, 1.0, 1.5), yaw=0.0):
    """Tracks of `size` from (gap to the front bumper, y, vx, vy)."""
    table = [
        [n, 0, gap + FRONT + size[0] / 2, y, 0, *size, yaw, vx, vy, 0, 2]
        for n, (gap, y, vx, vy) in enumerate(rows)
    ]
    return Tracks.from_rows(np.array(table, dtype=float).reshape(-1, len(Tracks.COLUMNS)))


def brakes(*rows, speed=10.0, **kwargs):
    return controller().command(objects(*rows, **kwargs), Ego(speed)).braking


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


def test_a_free_road_holds_the_cruising_speed():
    software = controller(cruise=8.0)
    assert software.command(objects(), Ego(8.0)).acceleration == 0.0
    assert software.command(objects(), Ego(7.9)).acceleration == pytest.approx(1.0)
    assert software.command(objects(), Ego(2.0)).acceleration == 1.5
    assert software.command(objects(), Ego(9.0)).acceleration == -1.5


def test_at_standstill_it_waits_for_what_is_within_two_metres():
    assert brakes((1.99, 0, 0, 0), speed=0.0)
    assert not brakes((2.01, 0, 0, 0), speed=0.0)


LEFT_TURN = Route(legs=((10.0, 0.0), (8.0 * np.pi / 2, 1 / 8.0)))
"""Ten metres ahead, then a quarter circle to the left, then along y at x = 18."""


def track(x, y, yaw=0.0, velocity=(0.0, 0.0)):
    row = [0, 4, x, y, 0.9, 0.7, 0.6, 1.8, yaw, *velocity, 0, 5]
    return Tracks.from_rows(np.array([row], float))


def test_a_person_beyond_the_bend_walks_across_the_way():
    sensor = Frame(0.0, 0.0, 1.84, 0.0)
    # At (20, 20), two metres to the right of the way that goes along y there, walking to the left.
    laid = along_route(track(20.0, 20.0, np.pi, (-1.5, 0.0)), LEFT_TURN, sensor)
    x, y, *_, yaw = laid.boxes[0]
    assert x == pytest.approx(10.0 + 4.0 * np.pi + 12.0)
    assert y == pytest.approx(-2.0)
    assert np.cos(yaw - np.pi / 2) == pytest.approx(1.0)
    assert laid.velocities[0] == pytest.approx([0.0, 1.5])


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
    assert enters_strip(rows_of(*inside), 1.5, 0.9).all()
    assert not enters_strip(rows_of(*outside), 1.5, 0.9).any()
    crossing = rows_of((5.0, 3.0, -1.0), (5.0, -3.0, 1.0), (5.0, 3.0, 1.0))
    assert not enters_strip(crossing, 1.5, 0.9).any()
    assert enters_strip(crossing, 1.5, 0.9, 1.2).tolist() == [True, True, False]


LENGTH, WIDTH = 4.0, 1.8
REACH = HALF_WIDTH + 0.3
LEAVES = REACH + WIDTH / 2
"""So far sideways the middle of a car is when it leaves the strip."""
STOPPING_AT_10 = 10 * 0.3 + 10**2 / (2 * 5.0) + 2.0
LANE = 3.5


def foreseeing(foresees=True, cruise=10.0):
    rules = DriverSettings(brake_for_oncoming=foresees)
    return Brake(cruise, FRONT, HALF_WIDTH, KEYFRAME, rules)


def car(x, y, vx, vy, yaw=0.0):
    """A track of a car with its middle at (x, y)."""
    row = [0, 0, x, y, 0, LENGTH, WIDTH, 1.5, yaw, vx, vy, 0, 2]
    return Tracks.from_rows(np.array([row], dtype=float))


def brakes_for(gap, y, vx, vy, foresees=True, speed=10.0):
    """Whether the brake goes on for a car with its box `gap` before the front bumper."""
    tracks = car(gap + FRONT + LENGTH / 2, y, vx, vy)
    return foreseeing(foresees).command(tracks, Ego(speed)).braking


def test_who_comes_head_on_counts_where_it_is_in_two_seconds():
    nearer = 5.0 * 2.0
    assert brakes_for(STOPPING_AT_10 + nearer - 0.01, 0.0, -5.0, 0.0)
    assert not brakes_for(STOPPING_AT_10 + nearer + 0.01, 0.0, -5.0, 0.0)
    assert not brakes_for(STOPPING_AT_10 + 0.01, 0.0, -5.0, 0.0, foresees=False)


@pytest.mark.parametrize("side", [1, -1])
def test_who_cuts_across_counts_where_it_leaves_the_strip(side):
    """From 6 m beside the way at 5 m/s towards it, it has left the strip after 8.1 m, and come
    nearer by 3 m/s for as long."""
    nearer = 3.0 * (6.0 + LEAVES) / 5.0
    assert brakes_for(STOPPING_AT_10 + nearer - 0.01, side * 6.0, -3.0, -side * 5.0)
    assert not brakes_for(STOPPING_AT_10 + nearer + 0.01, side * 6.0, -3.0, -side * 5.0)


@pytest.mark.parametrize("gap", [-1.0, 1.0, 10.0, 30.0])
def test_who_passes_in_its_own_lane_is_no_reason_to_brake(gap):
    assert not brakes_for(gap, LANE, -14.0, 0.0)
    assert not brakes_for(gap, LANE, -14.0, -0.3)


@pytest.mark.parametrize("way", [(0.0, 0.0), (5.0, 0.0), (0.0, -4.0), (3.0, -4.0)])
@pytest.mark.parametrize("y", [0.0, 4.0])
def test_who_stands_drives_ahead_or_crosses_at_right_angles_counts_as_before(way, y):
    for gap in np.arange(0.0, 20.0, 0.5):
        assert brakes_for(gap, y, *way) == brakes_for(gap, y, *way, foresees=False)


speeds = st.floats(0.0, 20.0)


@given(
    st.floats(0.0, 60.0), st.floats(-10.0, 10.0), speeds, st.floats(-15.0, 15.0),
    st.floats(1.0, 4.0), speeds,
)  # fmt: skip
def test_more_speed_of_the_other_never_brakes_later(gap, y, nearing, sideways, times, ego):
    if brakes_for(gap, y, -nearing, sideways, speed=ego):
        # A micrometre for the last bits of the limit.
        assert brakes_for(gap - 1e-6, y, -nearing * times, sideways * times, speed=ego)
    if brakes_for(gap, y, -nearing, sideways, foresees=False, speed=ego):
        assert brakes_for(gap, y, -nearing, sideways, speed=ego)


@given(st.floats(-10.0, 10.0), st.floats(-15.0, 15.0))
def test_who_enters_the_strip_is_followed_until_it_leaves_or_for_two_seconds(y, sideways):
    track = car(20.0, y, -5.0, sideways)
    until = leaves_s((20.0, y, LENGTH / 2, WIDTH / 2), sideways, (0.0, REACH, 2.0))

    def beside(time):
        return abs(y + sideways * time)

    if enters_strip(track, FRONT, REACH, 2.0)[0]:
        assert until >= 0.0
        assert beside(until) <= LEAVES + 1e-6
        begins = beside(max(until - 2.0, 0.0))
        assert beside(until) == pytest.approx(LEAVES) or (
            until == 2.0 if beside(0.0) <= LEAVES else begins == pytest.approx(LEAVES)
        )


@pytest.mark.parametrize(
    ("degrees", "their_mps"), [(20, 12.0), (30, 8.0), (45, 5.0), (45, 12.0), (70, 5.0), (70, 12.0)]
)
def test_the_ego_stands_before_all_that_the_other_sweeps(degrees, their_mps):
    """An ego that goes on at 6 m/s meets it after 5 s. It is in the strip for less than two."""
    vx, vy = their_mps * np.array([-np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
    yaw = np.arctan2(vy, vx)
    meet_x, meet_s = 5.0 * 6.0 + FRONT, 5.0
    software, speed, gone, nearest = foreseeing(cruise=6.0), 6.0, 0.0, np.inf
    for index in range(80):
        left = meet_s - index * KEYFRAME
        seen = car(meet_x - gone - vx * left, -vy * left, vx, vy, yaw)
        if enters_strip(seen, FRONT, HALF_WIDTH, 0.0)[0]:
            nearest = min(nearest, seen.boxes[0, 0] - corner(yaw) - FRONT)
        command = software.command(seen, Ego(speed))
        slower = float(np.clip(speed + command.acceleration * KEYFRAME, 0.0, 6.0))
        gone += (speed + slower) / 2 * KEYFRAME
        speed = slower
    # It stands two metres short of where the other is nearest, give or take a keyframe's way of
    # the ego.
    assert nearest > 2.0 - 6.0 * KEYFRAME - 0.01


def corner(yaw):
    """Half of what a car takes along the ego's way."""
    return (LENGTH * abs(np.cos(yaw)) + WIDTH * abs(np.sin(yaw))) / 2


def turned_across_an_oncoming_car():
    """Euro NCAP's CCFtap at 20 km/h against 60 km/h, under a full scan."""
    env = gymnasium.make(
        "care_sim:CARE-NCAP-v0", disable_env_checker=True, budget=1.0, test="CCFtap",
        speed_kph=20.0, target_kph=60.0,
    )  # fmt: skip
    with env:
        policy = care_sim.make_policy("full", env)
        observation, _ = env.reset(seed=0)
        ended = False
        while not ended:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            ended = terminated or truncated
        return info["outcome"], env.unwrapped.loop.world.ego.speed


def test_it_stands_before_the_way_of_an_oncoming_car_that_it_would_turn_across():
    outcome, speed = turned_across_an_oncoming_car()
    assert not outcome["collision"]
    assert speed == 0.0
