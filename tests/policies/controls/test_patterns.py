"""Controls that never look: their cells by hand."""

from dataclasses import dataclass

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.policies import controls, make_policy, tags_of
from care_sim.policies.controls.patterns import (
    Fan,
    Place,
    Rows,
    Stride,
    Sweep,
    cells_by_row,
    entry_elevation_deg,
)
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.policies.paper.tracks import uniform_pattern

CONTROLS = [
    "rows",
    "fan",
    "stride",
    "sweep",
    "place",
    "history-rows",
    "history-place",
    "place-hulls",
    "learned-place",
    "history-learned-place",
]
PATTERNS = [Rows, Fan, Stride, Sweep, Place]
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


@pytest.mark.parametrize("name", CONTROLS)
def test_a_control_is_tagged_and_no_contender(name):
    assert "control" in tags_of(name)
    assert name not in care_sim.policies.contenders()


def test_these_are_the_controls_that_a_car_can_have():
    assert {*controls()} == {*CONTROLS}


@pytest.mark.parametrize("make", PATTERNS)
@pytest.mark.parametrize("budget", [1, 164, 492, GRID.size])
def test_a_pattern_names_as_many_cells_as_may_fire_once(make, budget):
    cells = chosen(make(Rig(budget=budget)))
    assert len(np.unique(cells)) == len(cells) == budget
    assert 0 <= cells.min() <= cells.max() < GRID.size


@pytest.mark.parametrize("name", CONTROLS[:5])
def test_a_pattern_fires_the_same_whatever_it_is_shown(name):
    """Two scenarios and two seeds, of which it sees nothing."""
    fired = []
    for scenario, seed in (("CARE-Dartout-v0", 0), ("CARE-CutIn-v0", 5)):
        with gymnasium.make(f"care_sim:{scenario}", budget=0.03) as env:
            policy = make_policy(name, env)
            observation, _ = env.reset(seed=seed)
            policy.reset()
            fired.append([])
            for _ in range(3):
                action = policy(observation)
                observation, *_ = env.step(action)
                fired[-1].append(np.flatnonzero(action))
    assert all(np.array_equal(a, b) for a, b in zip(*fired, strict=True))


def test_rows_begin_where_a_car_enters_the_range():
    """-1.25 degrees lies nearest to row 9 at -1.33, then row 8 at 0.0 and row 10 at -2.67."""
    rows = cells_by_row(Rig())[:: GRID.columns] // GRID.columns
    assert rows[:3].tolist() == [9, 8, 10]
    assert sorted(rows) == [*range(GRID.rows)]


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


@pytest.mark.parametrize("budget", [100, 1638])
def test_the_stride_is_the_even_pattern_of_the_budget_that_it_is_told(budget):
    ((cells,),) = Stride(Rig(budget=819)).demand(BudgetAlone(budget)).layers
    assert np.array_equal(cells, uniform_pattern(GRID, budget))


def test_place_takes_the_highest_of_its_map(tmp_path):
    sightings = np.zeros(GRID.shape, np.float32)
    sightings[9, 300] = 2
    sightings[4, 7] = 3
    save_weights(tmp_path / "map.npz", {"sightings": sightings}, Card("place", GRID))
    cells = chosen(Place(Rig(budget=GRID.size), tmp_path / "map.npz"))
    assert cells[:2].tolist() == [4 * 512 + 7, 9 * 512 + 300]
    rows = cells_by_row(Rig())
    assert np.array_equal(cells[2:], rows[~np.isin(rows, cells[:2])])


def test_place_refuses_weights_of_another_kind(tmp_path):
    save_weights(tmp_path / "other.npz", {}, Card("learned-scorer", GRID))
    with pytest.raises(InvalidInput, match="kind is 'learned-scorer', needed is 'place'"):
        Place(Rig(), tmp_path / "other.npz")


@pytest.mark.parametrize("elevation", [float("nan"), 91, "level"])
def test_rows_refuse_what_is_no_elevation(elevation):
    with pytest.raises(InvalidInput, match="elevation_deg must lie in"):
        Rows(Rig(), elevation)


@pytest.mark.parametrize("make", PATTERNS)
def test_the_order_of_cells_leaves_a_pattern_as_it_is(make):
    """In random order other cells would come first."""
    fired = []
    for order in ("as-demanded", "random"):
        with gymnasium.make("CARE-Dense-v0", budget=0.03, cell_order=order) as env:
            observation, _ = env.reset(seed=0)
            fired.append(make_policy(make.name, env)(observation))
    assert np.array_equal(*fired)


@pytest.mark.parametrize("shape", [(64, 16), (1024, 64)])
@pytest.mark.parametrize("make", [Rows, Fan, Stride, Sweep])
def test_a_pattern_covers_any_grid(make, shape):
    grid = AngularGrid(*shape)
    cells = chosen(make(Rig(grid=grid, budget=grid.size)))
    assert sorted(cells) == [*range(grid.size)]


def test_the_stride_makes_its_pattern_once():
    policy = Stride(Rig(budget=492))
    assert chosen(policy) is chosen(policy)
