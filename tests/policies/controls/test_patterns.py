"""Controls that never look: their cells by hand."""

from dataclasses import dataclass

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.policies import controls
from care_sim.policies.controls.patterns import (
    Fan,
    Place,
    Rows,
    Stride,
    Sweep,
    TunedPlace,
    cells_by_row,
    entry_elevation_deg,
    likeliest_cells,
)
from care_sim.policies.controls.patterns_and_tracks import HistoryPlace, HistoryRows, PlaceHulls
from care_sim.policies.controls.rehearsed import HistoryLearnedPlace, learned_cells
from care_sim.policies.learned.weights import Card, save_weights

CONTROLS = [
    "rows",
    "fan",
    "stride",
    "sweep",
    "place",
    "tuned-place",
    "history-rows",
    "history-place",
    "place-hulls",
    "learned-place",
    "history-learned-place",
]
PATTERNS = [Rows, Fan, Stride, Sweep, Place, TunedPlace]
GRID = AngularGrid()


@dataclass(frozen=True)
class BudgetAlone:
    """All of a belief that a pattern may read."""

    budget: int


def chosen(policy):
    """The cells asked for at the next keyframe, best first."""
    belief = BudgetAlone(policy.rig.budget)
    policy.remember(belief)
    ((cells,),) = policy.demand(belief).layers
    return cells


def test_these_are_the_controls_that_a_car_can_have():
    assert {*controls()} == {*CONTROLS}


@pytest.mark.parametrize("make", PATTERNS)
@pytest.mark.parametrize("budget", [1, 164, 492, GRID.size])
def test_a_pattern_names_as_many_cells_as_may_fire_once(make, budget):
    cells = chosen(make(Rig(budget=budget)))
    assert len(np.unique(cells)) == len(cells) == budget
    assert 0 <= cells.min() <= cells.max() < GRID.size


@pytest.mark.parametrize(
    ("height", "elevation", "first"),
    [(1.84, -1.25, [9, 8, 10]), (0.5, 0.29, [8, 7, 9]), (3.0, -2.58, [10, 9, 11])],
)
def test_rows_begin_there_wherever_the_lidar_stands(height, elevation, first):
    """The middle of a car, 0.75 m up, is 50 m away seen at atan(0.25 / 50) from a LiDAR that stands
    0.5 m high, and at atan(-2.25 / 50) from one that stands 3 m high.
    """
    rig = Rig(sensor_height_m=height)
    assert entry_elevation_deg(rig) == elevation
    rows = cells_by_row(rig)[:: GRID.columns] // GRID.columns
    assert rows[:3].tolist() == first
    assert chosen(Rows(rig))[0] // GRID.columns == first[0]


def test_the_last_row_is_thinned_evenly():
    cells = chosen(Rows(Rig(budget=GRID.columns + 64)))[GRID.columns : GRID.columns + 64]
    gaps = np.diff(np.sort(cells % GRID.columns))
    assert set(cells // GRID.columns) == {8}
    assert gaps.min() >= 4
    assert gaps.max() <= 13


def test_the_fan_is_the_cone_ahead():
    cells = chosen(Fan(Rig(budget=504)))[:504]
    x, y, z = GRID.directions[cells].T
    assert np.abs(np.rad2deg(np.arctan2(y, x))).max() < 20
    elevations = np.rad2deg(np.arcsin(z))
    assert elevations.min() > -10.7
    assert elevations.max() < 0.1
    everything = np.rad2deg(np.arctan2(GRID.directions[:, 1], GRID.directions[:, 0]))
    level = np.rad2deg(np.arcsin(GRID.directions[:, 2]))
    cone = (np.abs(everything) < 19) & (level < 0.1) & (level > -10.7)
    assert set(np.flatnonzero(cone)) <= set(cells)


def test_the_sweep_goes_on_where_it_stopped():
    policy = Sweep(Rig(budget=100))
    first, second = (chosen(policy) for _ in range(2))
    assert (first % GRID.columns).tolist() == [n // 32 for n in range(100)]
    assert second[0] == 3 + 4 * GRID.columns
    policy.reset()
    assert np.array_equal(chosen(policy), first)


def test_the_sweep_fires_every_cell_once_in_a_turn():
    """16 times 1000 cells and the first 384 of the 17th keyframe."""
    policy = Sweep(Rig(budget=1000))
    cells = np.concatenate([chosen(policy) for _ in range(17)])
    assert sorted(cells[: GRID.size]) == [*range(GRID.size)]
    assert np.array_equal(cells[GRID.size :], cells[: 17_000 - GRID.size])


def test_place_takes_the_highest_of_its_map(tmp_path):
    sightings = np.zeros(GRID.shape, np.float32)
    sightings[9, 300] = 2
    sightings[4, 7] = 3
    save_weights(tmp_path / "map.npz", {"sightings": sightings}, Card("place", GRID))
    cells = chosen(Place(Rig(budget=GRID.size), tmp_path / "map.npz"))
    assert cells[:2].tolist() == [4 * 512 + 7, 9 * 512 + 300]
    rows = cells_by_row(Rig())
    assert np.array_equal(cells[2:], rows[~np.isin(rows, cells[:2])])


HULL = [row * GRID.columns + column for row in range(7, 14) for column in range(249, 263)]
"""The hull of a car 1.95 m wide whose rear is 17.7 m ahead: 3.2 degrees, 4.5 columns, to either
side, and 2 columns of margin. From 1.85 m below the sensor there, -6.0 degrees, to 0.15 m below it
at its front 22.3 m away, -0.4 degrees: rows 8 to 12, and 1 row of margin.
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


@pytest.fixture
def map_file(tmp_path):
    """A map of two cells; the others follow as `rows` has them."""
    sightings = np.zeros(GRID.shape, np.float32)
    sightings[4, 7] = 3
    sightings[9, 300] = 2
    save_weights(tmp_path / "map.npz", {"sightings": sightings}, Card("place", GRID))
    return tmp_path / "map.npz"


def test_the_map_has_its_share_first_and_the_hulls_two_rounds(map_file, belief_of, car):
    """35% of 819 cells are 286; a round is two cells for each of the three returns."""
    rig = Rig()
    belief = belief_of([car(1, 20), car(2, 12, -9)])
    first, few, more, rest = PlaceHulls(rig, map_file).demand(belief).layers
    likeliest = likeliest_cells(rig, map_file)
    assert likeliest[:2].tolist() == [4 * GRID.columns + 7, 9 * GRID.columns + 300]
    assert [cells.tolist() for cells in first] == [likeliest[:286].tolist()]
    assert [cells.tolist() for cells in rest] == [likeliest[:819].tolist()]

    # A near car's core holds more than both rounds.
    cores = rig.grid.hulls(belief.tracks.boxes, 0, 0)
    for one, other, core in zip(few, more, cores, strict=True):
        assert len({*one} | {*other}) == 12
        assert {*one} | {*other} <= {*core}
