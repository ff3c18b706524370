"""Braking for who comes towards the ego: on a straight way, in a bend, and in a turn across it."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import care_sim
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.types import Ego, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.driving.corridor import along_route, enters_strip, leaves_strip_s
from care_sim.world.route import Route

FRONT, HALF_WIDTH, KEYFRAME = 2.5, 0.9, 0.1
LENGTH, WIDTH = 4.0, 1.8
REACH = HALF_WIDTH + 0.3
LEAVES = REACH + WIDTH / 2
"""So far sideways the middle of a car is when it leaves the strip."""
STOPPING_AT_10 = 10 * 0.3 + 10**2 / (2 * 5.0) + 2.0
LANE = 3.5


def controller(foresees=True, cruise=10.0):
    rules = DriverSettings(brake_for_oncoming=foresees)
    return BrakingController(cruise, FRONT, HALF_WIDTH, KEYFRAME, rules)


def car(x, y, vx, vy, yaw=0.0):
    """A track of a car with its middle at (x, y)."""
    row = [0, 0, x, y, 0, LENGTH, WIDTH, 1.5, yaw, vx, vy, 0, 2]
    return Tracks.from_rows(np.array([row], dtype=float))


def brakes(gap, y, vx, vy, foresees=True, speed=10.0):
    """Whether the brake goes on for a car with its box `gap` before the front bumper."""
    tracks = car(gap + FRONT + LENGTH / 2, y, vx, vy)
    return controller(foresees).command(tracks, Ego(speed)).braking


def test_who_comes_head_on_counts_where_it_is_in_two_seconds():
    nearer = 5.0 * 2.0
    assert brakes(STOPPING_AT_10 + nearer - 0.01, 0.0, -5.0, 0.0)
    assert not brakes(STOPPING_AT_10 + nearer + 0.01, 0.0, -5.0, 0.0)
    assert not brakes(STOPPING_AT_10 + 0.01, 0.0, -5.0, 0.0, foresees=False)


@pytest.mark.parametrize("side", [1, -1])
def test_who_cuts_across_counts_where_it_leaves_the_strip(side):
    """From 6 m beside the way at 5 m/s towards it, it has left the strip after 8.1 m, and come
    nearer by 3 m/s for as long."""
    nearer = 3.0 * (6.0 + LEAVES) / 5.0
    assert brakes(STOPPING_AT_10 + nearer - 0.01, side * 6.0, -3.0, -side * 5.0)
    assert not brakes(STOPPING_AT_10 + nearer + 0.01, side * 6.0, -3.0, -side * 5.0)


def test_who_is_about_to_leave_the_strip_comes_no_nearer():
    nearer = 10.0 * 0.1 / 5.0
    assert brakes(STOPPING_AT_10 + nearer - 0.01, LEAVES - 0.1, -10.0, 5.0)
    assert not brakes(STOPPING_AT_10 + nearer + 0.01, LEAVES - 0.1, -10.0, 5.0)


@pytest.mark.parametrize("gap", [-1.0, 1.0, 10.0, 30.0])
def test_who_passes_in_its_own_lane_is_no_reason_to_brake(gap):
    assert not brakes(gap, LANE, -14.0, 0.0)
    assert not brakes(gap, LANE, -14.0, -0.3)


@pytest.mark.parametrize("way", [(0.0, 0.0), (5.0, 0.0), (0.0, -4.0), (3.0, -4.0)])
@pytest.mark.parametrize("y", [0.0, 4.0])
def test_who_stands_drives_ahead_or_crosses_at_right_angles_counts_as_before(way, y):
    for gap in np.arange(0.0, 20.0, 0.5):
        assert brakes(gap, y, *way) == brakes(gap, y, *way, foresees=False)


speeds = st.floats(0.0, 20.0)


@given(
    st.floats(0.0, 60.0), st.floats(-10.0, 10.0), speeds, st.floats(-15.0, 15.0),
    st.floats(1.0, 4.0), speeds,
)  # fmt: skip
def test_more_speed_of_the_other_never_brakes_later(gap, y, nearing, sideways, times, ego):
    if brakes(gap, y, -nearing, sideways, speed=ego):
        # A micrometre for the last bits of the limit.
        assert brakes(gap - 1e-6, y, -nearing * times, sideways * times, speed=ego)
    if brakes(gap, y, -nearing, sideways, foresees=False, speed=ego):
        assert brakes(gap, y, -nearing, sideways, speed=ego)


@given(st.floats(-10.0, 10.0), st.floats(-15.0, 15.0))
def test_who_enters_the_strip_is_followed_until_it_leaves_or_for_two_seconds(y, sideways):
    track = car(20.0, y, -5.0, sideways)
    (until,) = leaves_strip_s(track, REACH, 2.0)

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
    software, speed, gone, nearest = controller(cruise=6.0), 6.0, 0.0, np.inf
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


@pytest.mark.parametrize("curvature", [1 / 15, -1 / 15, 1 / 40])
def test_who_passes_in_the_opposite_lane_of_a_bend_is_no_reason_to_brake(curvature):
    """Either goes 8 m/s in its lane, and the tracker tells the way between two keyframes."""
    route = Route(legs=((80.0, curvature),))
    software, before = controller(cruise=8.0), None
    for index in range(70):
        here = lane_place(route, 75.0 - 8.0 * KEYFRAME * index)
        ego_x, ego_y, ego_yaw = route.pose(5.0 + 8.0 * KEYFRAME * index)
        sensor = Frame(ego_x, ego_y, 1.8, ego_yaw)
        if before is not None:
            vx, vy = (here - before) / KEYFRAME
            world = Frame(0.0, 0.0, 1.8, 0.0)
            seen = moved(car(*here, vx, vy, np.arctan2(vy, vx)), world, sensor)
            laid = along_route(seen, route, sensor)
            assert not software.command(laid, Ego(8.0)).braking
        before = here


def lane_place(route, s):
    """The middle of the lane to the left of a route."""
    x, y, heading = route.pose(s)
    return np.array([x - LANE * np.sin(heading), y + LANE * np.cos(heading)])


def moved(tracks, from_frame, to_frame):
    """Tracks of one frame in another."""
    boxes = to_frame.boxes_to_local(from_frame.boxes_to_world(tracks.boxes))
    velocities = to_frame.vectors_to_local(np.column_stack([tracks.velocities, [0.0]]))[:, :2]
    return tracks.moved(boxes, velocities)


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
