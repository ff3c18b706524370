"""Policies with several LiDARs: each LiDAR has its own rows, ahead, and lines of sight."""

import numpy as np
import pytest

from care_sim.core.belief import Belief
from care_sim.core.cells.stack import GridStack
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.policies.controls.patterns import Fan, cells_by_row, entry_cells, entry_elevation_deg
from care_sim.policies.learned.cell_inputs import CellInputs
from care_sim.policies.learned.grid_features import CHANNELS, GridFeatures
from care_sim.policies.own.sight_lines import AHEAD_RAD, SightLines, columns_ahead
from care_sim.policies.paper.blind import horizon_rows
from tests.helpers.lidars import DEGREE, ROOF, STACK

RIG = Rig(STACK, budget=100, sensor_height_m=1.8)
ALONE = GridStack((ROOF,), ((0.0, 0.0, 0.0),))
ORIGIN = (0.0, 0.0, 0.0)


def belief(ranges, rig=RIG):
    """A car at 10 m/s without cameras, after a scan."""
    none = ImageDetections.from_rows(np.empty((0, 9)))
    tracks = Tracks.from_rows(np.empty((0, 13)))
    return Belief(Ego(10.0), rig.budget, none, tracks, ranges.reshape(rig.grid.shape))


def of_heads(cells, grid=STACK):
    """The number of the LiDAR of every cell."""
    return np.searchsorted([head.first for head in grid.heads], cells, side="right") - 1


def test_every_lidar_begins_with_the_row_that_suits_its_height():
    """From 1.8 m the middle of a car at 50 m is 1.2 degrees down, from 0.5 m 0.29 degrees up."""
    cells = cells_by_row(RIG)
    assert sorted(cells.tolist()) == list(range(STACK.size))
    assert entry_elevation_deg(RIG, -1.3) == pytest.approx(0.29)
    entries = entry_cells(RIG)
    assert entries.shape == (3 * 64,)
    assert {*cells[: 3 * 64].tolist()} == {*entries.tolist()}
    # Cell by cell in turn, so that a budget is shared.
    assert of_heads(cells[:9]).tolist() == [0, 1, 2] * 3
    for head, own in zip(STACK.heads, np.split(entries, 3), strict=True):
        assert ((own >= head.first) & (own < head.cells.stop)).all()
        assert (own % 64).tolist() == list(range(64))
    # Rows of the roof are 4 degrees apart from +6 down: -2 is nearest. The nearest row of the left
    # corner is at 0.
    assert {*(entries[:64] // 64).tolist()} == {2}
    assert {*(entries[64:128] // 64).tolist()} == {8 + 2}


def test_fan_widens_to_both_sides_over_all_lidars():
    policy = Fan(RIG)
    cells = policy.demand(belief(np.zeros(STACK.size, np.float32))).layers[0][0]
    directions = STACK.directions[cells]
    assert {*of_heads(cells).tolist()} == {0, 1, 2}
    azimuths = np.concatenate([head.grid.azimuths for head in STACK.heads])
    off = np.abs(azimuths[of_heads(cells) * 64 + cells % 64])
    assert (np.diff(off) >= -1e-9).all()
    assert (directions[:, 2] < np.sin(2.1 * DEGREE)).all()
    assert (directions[:, 2] > np.sin(-15 * DEGREE)).all()


def test_the_sector_ahead_is_that_of_every_lidar():
    columns = columns_ahead(STACK)
    azimuths = np.concatenate([head.grid.azimuths for head in STACK.heads])
    assert sorted(columns.tolist()) == np.flatnonzero(np.abs(azimuths) <= AHEAD_RAD).tolist()
    assert (np.diff(np.abs(azimuths[columns])) >= 0).all()
    assert {*(columns // 64).tolist()} == {0, 1, 2}


def test_lines_of_sight_are_remembered_lidar_by_lidar():
    """A wall 10 m before the left corner closes its lines and those of no other."""
    lines = entry_cells(RIG)
    memory = SightLines(RIG, lines)
    assert {*of_heads(memory.cells()).tolist()} == {0, 1, 2}
    ranges = np.zeros(STACK.size, np.float32)
    head = STACK.heads[1]
    ranges[head.cells] = 10.0
    memory.update(belief(ranges))
    assert {*of_heads(memory.cells()).tolist()} == {0, 2}
    # Nearer by what the car has driven, as the wall straight ahead of the corner is.
    ahead = 64 + int(np.argmin(np.abs(head.grid.azimuths)))
    assert memory.ranges[ahead] == pytest.approx(9.0, abs=0.02)
    assert (memory.ranges[:64] == 80.0).all()
    assert {*of_heads(memory.ahead()).tolist()} <= {0, 2}


def test_one_lidar_in_a_stack_is_chosen_from_as_if_it_were_the_grid():
    one, other = Rig(ALONE, budget=100), Rig(ROOF, budget=100)
    assert np.array_equal(cells_by_row(one), cells_by_row(other))
    assert np.array_equal(entry_cells(one), entry_cells(other))
    assert np.array_equal(columns_ahead(ALONE), columns_ahead(ROOF))
    assert [cells.tolist() for cells in horizon_rows(ALONE, 150)] == [
        cells.tolist() for cells in horizon_rows(ROOF, 150)
    ]
    nothing = np.zeros(ROOF.size, np.float32)
    fans = [Fan(rig).demand(belief(nothing, rig)).layers[0][0].tolist() for rig in (one, other)]
    assert fans[0] == fans[1]


def test_a_return_stands_above_the_road_by_the_height_of_its_own_lidar():
    """Level rays at 0.5 m above the road and at 1.8 m both meet what stands; 0.5 m down, the first
    meets the road.
    """
    level = AngularGrid(64, 2, 0.0, -5 * DEGREE)
    low = GridStack((level, level), (ORIGIN, (2.0, 0.0, -1.3)))
    rig = Rig(low, budget=10, sensor_height_m=1.8)
    ranges = np.zeros(low.size, np.float32)
    # Both 5 m off and 5 degrees down: 1.36 m above the road, and 0.06 m.
    high, deep = 64 + 32, 128 + 64 + 32
    ranges[[high, deep]] = 5.0
    seen = belief(ranges, rig)
    features = GridFeatures(rig, 64, 4)(seen)["grid"].reshape(len(CHANNELS), -1)
    standing = features[CHANNELS.index("undetected")]
    assert np.flatnonzero(standing).tolist() == [64 + 32]
    inputs = CellInputs(rig)
    marks = inputs.of(seen, []).rows(np.array([high, deep]))
    assert marks[:, 5].tolist() == [1, 1]
    assert marks[:, 6].tolist() == [1, 0]
    # And the road is nearer to the lower one.
    nearness = inputs.rig_inputs[[high, deep], 1]
    assert nearness == pytest.approx(1 - np.array([1.8, 0.5]) / np.sin(5 * DEGREE) / 50)
