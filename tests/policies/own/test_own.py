"""Policies of our own: rounds, cores, lines of sight, on beliefs with known answers."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import MAX_DETECTIONS, Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.policies.controls.rows import nearest_rows
from care_sim.policies.own.care_spread import CareSpread
from care_sim.policies.own.sight_lines import EDGE_COLUMNS, SightLines

GRID = AngularGrid()
COLUMNS = GRID.columns
ROW = 9


def scan_of(row_ranges):
    """The last scan (E, A), in which nothing but row 9 was fired."""
    ranges = np.zeros(GRID.shape, np.float32)
    ranges[ROW] = row_ranges
    return ranges


def blind(observation):
    """The same observation without a camera detection."""
    padding = np.zeros((MAX_DETECTIONS, len(ImageDetections.COLUMNS)), np.float32)
    padding[:, 0] = -1
    return {**observation, "detections": padding}


@pytest.fixture
def lines():
    return SightLines(Rig(keyframe_s=0.5), ROW)


def columns_of(lines):
    return (lines.cells() - ROW * COLUMNS).tolist()


def test_lines_that_were_never_fired_are_open(lines):
    assert columns_of(lines) == [*range(COLUMNS)]


def test_open_lines_and_the_edges_of_what_hides_are_watched(lines, belief_of):
    """A wall at 10 m in columns 100 to 199, nothing elsewhere: its inside is not watched."""
    ranges = np.full(COLUMNS, GRID.range_m)
    ranges[100:200] = 10
    lines.update(belief_of(ranges=scan_of(ranges)))
    hidden = range(100 + EDGE_COLUMNS, 200 - EDGE_COLUMNS)
    assert columns_of(lines) == [n for n in range(COLUMNS) if n not in hidden]


def test_a_wall_all_round_has_no_edge_over_the_seam(lines, belief_of):
    lines.update(belief_of(ranges=scan_of(10)))
    assert columns_of(lines) == []
    ranges = np.full(COLUMNS, 10.0)
    ranges[0] = 20
    lines.update(belief_of(ranges=scan_of(ranges)))
    near = [n % COLUMNS for n in range(-EDGE_COLUMNS, EDGE_COLUMNS + 1)]
    assert columns_of(lines) == sorted(near)


def test_what_was_not_fired_is_remembered_and_turns_with_the_car(lines, belief_of):
    """0.5 s at 1 rad/s are 40.7 columns. The car turns to the left, so things go to the right."""
    ranges = np.full(COLUMNS, 10.0)
    ranges[300] = 40
    lines.update(belief_of(ranges=scan_of(ranges)))
    lines.update(belief_of(ego=Ego(yaw_rate=1.0)))
    assert 300 - 41 in columns_of(lines)
    assert 300 not in columns_of(lines)


def test_what_stands_is_remembered_where_it_is_after_the_car_has_driven(lines, belief_of):
    """A post 10 m to the left, of 3 columns, and 5 m driven: 26.6 degrees further back, 37.8
    columns, and from farther away 2 columns wide."""
    left = 3 * COLUMNS // 4
    ranges = np.full(COLUMNS, GRID.range_m)
    ranges[left - 1 : left + 2] = 10
    lines.update(belief_of(ego=Ego(speed=10.0), ranges=scan_of(ranges)))
    watched = np.zeros(COLUMNS, bool)
    watched[columns_of(lines)] = True
    # The post is an edge all over, so that the ranges are read, not the columns watched.
    assert watched.all()
    assert np.flatnonzero(lines.ranges < GRID.range_m).tolist() == [left + 37, left + 38]
    assert lines.ranges[left + 38] == pytest.approx(np.hypot(10, 5), abs=0.1)


def test_a_wall_stays_closed_when_the_car_drives_towards_it(lines, belief_of):
    """From nearer it covers more columns: none of them is left open in between."""
    ranges = np.full(COLUMNS, GRID.range_m)
    azimuths = (np.arange(COLUMNS) + 0.5) * GRID.column_width - np.pi
    wall = np.abs(azimuths) < np.pi / 4
    ranges[wall] = 15 / np.cos(azimuths[wall])
    lines.update(belief_of(ego=Ego(speed=15.0), ranges=scan_of(ranges)))
    straight_on = np.abs(azimuths) < np.pi / 4
    assert lines.ranges[straight_on].max() < 15


@given(
    ranges=arrays(np.float64, COLUMNS, elements=st.floats(0.5, GRID.range_m)),
    speed=st.floats(-5, 40),
    yaw_rate=st.floats(-3, 3),
)
def test_nothing_is_remembered_nearer_than_it_can_have_come(ranges, speed, yaw_rate):
    lines = SightLines(Rig(keyframe_s=0.5), ROW)
    belief = Belief(
        Ego(speed, yaw_rate),
        819,
        ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS)))),
        Tracks.from_rows(np.empty((0, len(Tracks.COLUMNS)))),
        scan_of(ranges),
    )
    lines.update(belief)
    least = max(1.0, ranges.min() - 0.5 * abs(speed))
    assert lines.ranges.min() >= min(least, GRID.range_m) - 1e-3
    assert lines.ranges.max() <= GRID.range_m + 0.5 * abs(speed)


def test_standing_still_forgets_nothing(lines, belief_of):
    ranges = np.linspace(1, GRID.range_m, COLUMNS)
    lines.update(belief_of(ranges=scan_of(ranges)))
    for _ in range(20):
        lines.update(belief_of())
    assert np.allclose(lines.ranges, ranges, atol=1e-3)


def test_ahead_are_the_lines_of_the_street_the_nearest_to_straight_ahead_first(lines):
    """atan(13 / 50) is 14.6 degrees, 20.7 columns to either side."""
    columns = lines.ahead() - ROW * COLUMNS
    assert sorted(columns) == [*range(COLUMNS // 2 - 21, COLUMNS // 2 + 21)]
    off = np.abs(columns + 0.5 - COLUMNS / 2)
    assert (np.diff(off) >= 0).all()


def test_with_a_short_reach_a_line_without_a_return_is_open(belief_of):
    rig = Rig(grid=AngularGrid(range_m=20.0))
    lines = SightLines(rig, ROW)
    lines.update(belief_of(ranges=scan_of(20)))
    assert len(lines.cells()) == COLUMNS
    lines.update(belief_of(ranges=scan_of(9)))
    assert len(lines.cells()) == 0


def test_every_hull_begins_with_its_core(belief_of, car):
    rig = Rig()
    belief = belief_of([car(1, 20, 3), car(2, 12, -9), car(3, -30, 2)])
    demand = CareSpread(rig).demand(belief)
    for first, bare, whole in zip(
        demand.layers[1],
        rig.grid.hulls(belief.tracks.boxes, 0, 0),
        rig.hulls(belief.tracks.boxes),
        strict=True,
    ):
        count = min(len(first), len(bare))
        assert set(first[:count]) <= set(bare)
        assert set(first) <= set(whole)
        assert len(first) == min(6, len(whole))


@pytest.mark.parametrize(("name", "layer"), [("care-spread", 1), ("care-sightlines", 2)])
@pytest.mark.parametrize("returns", [1, 3, 5])
def test_rounds_are_multiples_of_what_a_detection_needs(name, layer, returns, belief_of, car):
    """The environment tells the policy what its detector needs."""
    with gymnasium.make("CARE-Dense-v0", min_returns=returns) as env:
        demand = care_sim.make_policy(name, env).demand(belief_of([car(1, 5, 0), car(2, 9, 5)]))
    assert [len(cells) for cells in demand.layers[layer]] == [2 * returns] * 2


@pytest.mark.parametrize("name", ["care-spread", "care-sightlines"])
def test_hulls_and_wedges_follow_the_cell_order_of_the_rig(name, belief_of, car):
    belief = belief_of([car(1, 12, -9)])
    layer = {"care-spread": 1, "care-sightlines": 2}[name]
    with gymnasium.make("CARE-Dense-v0", cell_order="rows-down") as env:
        policy = care_sim.make_policy(name, env)
        (hull,) = policy.demand(belief).layers[layer]
        (whole,) = policy.rig.hulls(belief.tracks.boxes)
    assert hull.tolist() == sorted(whole)[:6]


def test_no_cell_of_a_set_is_asked_for_twice_in_a_round(environment, encounter):
    for name in ("care-spread", "care-sightlines"):
        policy = care_sim.make_policy(name, environment)
        for observation in encounter:
            policy(observation)
            for layer in policy.demanded.layers:
                for cells in layer:
                    assert len(np.unique(cells)) == len(cells)


def test_an_unexplained_wedge_is_served_before_any_hull(environment, encounter):
    policy = care_sim.make_policy("care-spread", environment)
    served = 0
    for observation in encounter:
        belief = Belief.from_observation(observation)
        unexplained, _ = camera_layers(belief, policy.rig)
        policy(observation)
        assert [len(cells) for cells in policy.demanded.layers[0]] == [
            min(9, len(cells)) for cells in unexplained
        ]
        served += len(unexplained)
    assert served


def test_without_camera_detections_it_plays_as_without_a_camera(environment, encounter):
    seeing, unseeing = (
        care_sim.make_policy("care-sightlines", environment, camera=camera)
        for camera in (True, False)
    )
    differing = 0
    for observation in encounter:
        differing += not np.array_equal(seeing(observation), unseeing(observation))
    assert differing
    for policy in (seeing, unseeing):
        policy.reset()
    for observation in encounter:
        assert np.array_equal(seeing(blind(observation)), unseeing(observation))


@pytest.mark.parametrize(
    ("idea", "layer"),
    [("ahead", 1), ("explained", 3), ("sight_lines", 4), ("rows", 6), ("rows", 8)],
)
def test_an_idea_can_be_switched_off(idea, layer, environment, encounter):
    policies = [
        care_sim.make_policy("care-sightlines", environment, **{idea: on}) for on in (True, False)
    ]
    asked = [0, 0]
    for observation in encounter:
        for number, policy in enumerate(policies):
            policy(observation)
            asked[number] += sum(map(len, policy.demanded.layers[layer]))
    assert asked[0] > 0
    assert asked[1] == 0


def test_the_budget_is_spent_without_the_floor(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    for observation in encounter:
        assert np.count_nonzero(policy(observation)) == policy.rig.budget


def test_a_late_picture_gets_one_round_of_its_wedges(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    rest = {}
    for age in (0.0, 0.1):
        asked = []
        for observation in encounter:
            detections = observation["detections"].copy()
            detections[:, ImageDetections.AGE] = age
            policy({**observation, "detections": detections})
            first, more = policy.demanded.layers[0], policy.demanded.layers[5]
            asked.append((sum(map(len, first)), sum(map(len, more))))
        rest[age] = np.sum(asked, axis=0)
    assert rest[0.0][0] == rest[0.1][0] > 0
    assert rest[0.0][1] > 0
    assert rest[0.1][1] == 0


def test_a_wedge_gets_as_many_rounds_as_asked_for(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment, wedge_rounds=2)
    longest = 0
    for observation in encounter:
        policy(observation)
        longest = max([longest, *map(len, policy.demanded.layers[5])])
    assert longest == 9


def test_the_last_layer_is_the_pattern_rows(environment, encounter):
    policy = care_sim.make_policy("care-sightlines", environment)
    policy(encounter[0])
    ((cells,),) = policy.demanded.layers[-1:]
    assert np.array_equal(cells, nearest_rows(policy.rig.grid))


@pytest.mark.parametrize("name", ["care-spread", "care-sightlines"])
@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"min_returns": 0}, "min_returns must be a whole number"),
        ({"min_returns": 2.5}, "min_returns must be a whole number"),
    ],
)
def test_bad_parameters_are_named(name, parameters, message):
    with (
        gymnasium.make("CARE-Dense-v0") as env,
        pytest.raises(InvalidInput, match=message),
    ):
        care_sim.make_policy(name, env, **parameters)


@pytest.mark.parametrize("idea", ["camera", "ahead", "explained", "sight_lines", "rows"])
def test_a_switch_is_true_or_false(idea):
    with (
        gymnasium.make("CARE-Dense-v0") as env,
        pytest.raises(InvalidInput, match=f"{idea} must be True or False"),
    ):
        care_sim.make_policy("care-sightlines", env, **{idea: 0.5})
