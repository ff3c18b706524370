"""Lines of sight on scans made by hand."""

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import care_sim
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.sensor_setup import SensorSetup
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.policies.controls.patterns import entry_cells
from care_sim.policies.own.sight_lines import EDGE_COLUMNS, SightLines

GRID = AngularGrid()
COLUMNS = GRID.columns
ROW = 9
LINES = np.arange(ROW * COLUMNS, (ROW + 1) * COLUMNS)


def scan_of(row_ranges):
    """The last scan (E, A), in which nothing but row 9 was fired."""
    ranges = np.zeros(GRID.shape, np.float32)
    ranges[ROW] = row_ranges
    return ranges


@pytest.fixture
def lines():
    return SightLines(Rig(keyframe_s=0.5), LINES)


def columns_of(lines):
    return (lines.cells() - ROW * COLUMNS).tolist()


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


def test_every_column_is_remembered_along_a_cell_of_its_own(belief_of):
    """The left half along row 9, the right half along row 11: there the wall stands, and what other
    rows meet says nothing.
    """
    right = np.arange(COLUMNS // 2)
    cells = np.concatenate([11 * COLUMNS + right, LINES[COLUMNS // 2 :]])
    lines = SightLines(Rig(keyframe_s=0.5), cells)
    ranges = np.full(GRID.size, GRID.range_m, np.float32)
    ranges[cells] = 10
    lines.update(belief_of(ranges=ranges.reshape(GRID.shape)))
    assert lines.cells().tolist() == []
    ranges[cells[:2]] = GRID.range_m
    lines.update(belief_of(ranges=ranges.reshape(GRID.shape)))
    # Open are columns 0 and 1, and watched the edges about them, over the seam, too.
    near = [*range(2 + EDGE_COLUMNS), *range(COLUMNS - EDGE_COLUMNS, COLUMNS)]
    assert lines.cells().tolist() == cells[near].tolist()


@pytest.mark.parametrize(("wall", "watched"), [(24.9, 0), (25.1, COLUMNS)])
@pytest.mark.parametrize("reach", [50.0, 100.0])
def test_a_line_is_open_from_half_the_range_of_scoring_on(wall, watched, reach, belief_of):
    lines = SightLines(Rig(grid=AngularGrid(range_m=reach)), LINES)
    lines.update(belief_of(ranges=scan_of(wall)))
    assert len(lines.cells()) == watched


@pytest.mark.parametrize(("step", "watched"), [(4.9, 0), (5.1, 4 * EDGE_COLUMNS)])
def test_an_edge_is_a_step_of_the_length_of_a_car(step, watched, lines, belief_of):
    """A recess in a wall has two edges; to either side of each its columns are watched."""
    ranges = np.full(COLUMNS, 10.0)
    ranges[100:200] += step
    lines.update(belief_of(ranges=scan_of(ranges)))
    assert len(lines.cells()) == watched


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


def test_of_two_posts_behind_each_other_the_nearer_one_is_remembered(lines, belief_of):
    """5 m ahead and 10 or 20 m to a side: 11.2 m at 63.4 degrees, 20.6 m at 76.0. After 5 m both
    stand at 90 degrees. On the left the nearer one has the lower column, on the right the higher.
    """
    ranges = np.full(COLUMNS, GRID.range_m)
    for column, distance in ((346, 11.18), (364, 20.62)):
        ranges[[column, COLUMNS - 1 - column]] = distance
    lines.update(belief_of(ego=Ego(speed=10.0), ranges=scan_of(ranges)))
    abreast = lines.ranges[[384, COLUMNS - 1 - 384]]
    assert abreast == pytest.approx([10, 10], abs=0.1)


@given(
    ranges=arrays(np.float64, COLUMNS, elements=st.floats(0.5, GRID.range_m)),
    speed=st.floats(-5, 40),
    yaw_rate=st.floats(-3, 3),
)
def test_nothing_is_remembered_nearer_than_it_can_have_come(ranges, speed, yaw_rate):
    lines = SightLines(Rig(keyframe_s=0.5), LINES)
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
    assert lines.ranges.max() <= GRID.range_m


def test_ahead_are_the_lines_of_the_street_the_nearest_to_straight_ahead_first(lines):
    """atan(13 / 50) is 14.6 degrees, 20.7 columns to either side."""
    columns = lines.ahead() - ROW * COLUMNS
    assert sorted(columns) == [*range(COLUMNS // 2 - 21, COLUMNS // 2 + 21)]
    off = np.abs(columns + 0.5 - COLUMNS / 2)
    assert (np.diff(off) >= 0).all()


def test_with_a_short_reach_a_line_without_a_return_is_open(belief_of):
    rig = Rig(grid=AngularGrid(range_m=20.0))
    lines = SightLines(rig, LINES)
    lines.update(belief_of(ranges=scan_of(20)))
    assert len(lines.cells()) == COLUMNS
    lines.update(belief_of(ranges=scan_of(9)))
    assert len(lines.cells()) == 0


def test_an_open_line_stays_open_where_float32_cannot_hold_the_reach(belief_of):
    """The scan says 33.299999 m. Taken for a surface, it would come nearer with the car."""
    lines = SightLines(Rig(grid=AngularGrid(range_m=33.3), keyframe_s=0.5), LINES)
    lines.update(belief_of(ego=Ego(speed=10.0), ranges=scan_of(33.3)))
    for _ in range(5):
        lines.update(belief_of(ego=Ego(speed=10.0)))
    assert len(set(lines.ranges)) == 1
    assert len(lines.cells()) == COLUMNS


@pytest.mark.parametrize(
    ("height", "pitch", "roll"),
    [(0.5, 0, 0), (1.84, -8, 6)],
)
def test_along_a_street_lines_of_sight_are_open_however_the_lidar_is_mounted(height, pitch, roll):
    """With the row at -1.33 degrees they would end on the road after 21 m from a LiDAR 0.5 m above
    it, less than the 25 m that count as open. A tilted one has no row for all of them.
    """
    tilt = {"pitch": np.deg2rad(pitch), "roll": np.deg2rad(roll)}
    setup = SensorSetup("one", AngularGrid(**tilt), (2.0, 0.0, height))
    with gymnasium.make("CARE-CutIn-v0", sensor=setup, budget=0.05) as env:
        policy = care_sim.make_policy("care-sightlines", env)
        observation, _ = env.reset(seed=5)
        for _ in range(3):
            observation, *_ = env.step(policy(observation))
        policy(observation)
        cells = entry_cells(policy.rig)
        open_lines = cells[observation["ranges"].ravel()[cells] > 30]
        assert 80 < len(open_lines) < 120
        assert set(open_lines.tolist()) <= set(policy.demanded.layers[4][0].tolist())


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (-8, 6)])
def test_every_column_has_the_cell_at_which_things_enter_the_range(pitch, roll):
    """Rows are 1.33 degrees apart, so that the nearest looks no more than 0.67 degrees off."""
    grid = AngularGrid(top=0.6, bottom=-0.6, pitch=np.deg2rad(pitch), roll=np.deg2rad(roll))
    cells = entry_cells(Rig(grid))
    assert (cells % grid.columns).tolist() == [*range(grid.columns)]
    elevations = np.rad2deg(np.arcsin(grid.directions[cells, 2]))
    assert np.abs(elevations + 1.25).max() <= np.rad2deg(grid.row_height) / 2 + 0.01
