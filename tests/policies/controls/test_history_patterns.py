"""Controls that follow their tracks and reserve for a pattern: one track, known cells."""

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.policies.controls.patterns import cells_by_row
from care_sim.policies.controls.patterns_and_tracks import HistoryPlace, HistoryRows
from care_sim.policies.controls.rehearsed import HistoryLearnedPlace, learned_cells
from care_sim.policies.learned.weights import Card, save_weights

GRID = AngularGrid()
HULL = [row * GRID.columns + column for row in range(7, 14) for column in range(249, 263)]
"""Of a car 1.95 m wide whose rear is 17.7 m ahead: 3.2 degrees, 4.5 columns, to either side, and 2
columns of margin. From 1.85 m below the sensor there, -6.0 degrees, to 0.15 m below it at its front
22.3 m away, -0.4 degrees: rows 8 to 12, and 1 row of margin.
"""


def test_the_hull_of_the_track_comes_first_and_then_the_rows(belief_of, car):
    demand = HistoryRows(Rig()).demand(belief_of([car(1, 20)]))
    assert [cells.tolist() for cells in demand.exploitation] == [HULL]
    ((pattern,),) = demand.layers
    assert np.array_equal(pattern, cells_by_row(Rig())[:819])


def test_the_hull_of_the_track_comes_first_and_then_the_map(belief_of, car, tmp_path):
    sightings = np.zeros(GRID.shape, np.float32)
    sightings[4, 7] = 3
    sightings[9, 300] = 2
    save_weights(tmp_path / "map.npz", {"sightings": sightings}, Card("place", GRID))
    demand = HistoryPlace(Rig(), tmp_path / "map.npz").demand(belief_of([car(1, 20)]))
    assert [cells.tolist() for cells in demand.exploitation] == [HULL]
    ((pattern,),) = demand.layers
    assert pattern[:2].tolist() == [4 * GRID.columns + 7, 9 * GRID.columns + 300]
    assert len(set(pattern)) == len(pattern) == 819


def test_the_hull_of_the_track_comes_first_and_then_the_learned_map(belief_of, car):
    demand = HistoryLearnedPlace(Rig(), "cutin", 1).demand(belief_of([car(1, 20)]))
    assert [cells.tolist() for cells in demand.exploitation] == [HULL]
    ((pattern,),) = demand.layers
    assert np.array_equal(pattern, learned_cells(Rig(), "cutin", 1)[:819])


@pytest.mark.parametrize("make", [HistoryRows, HistoryPlace])
def test_the_hull_follows_the_cell_order_of_the_rig_and_the_pattern_does_not(make, belief_of, car):
    belief = belief_of([car(1, 20)])
    usual, upwards = (make(Rig(cell_order=order)) for order in ("as-demanded", "rows-up"))
    (hull,) = upwards.demand(belief).exploitation
    assert hull.tolist() == sorted(HULL, key=lambda cell: (-(cell // GRID.columns), cell))
    assert np.array_equal(upwards.demand(belief).layers, usual.demand(belief).layers)
