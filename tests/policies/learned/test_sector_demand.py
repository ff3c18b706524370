import numpy as np

from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.policies.learned.sector_demand import reserve_demand, sector_demand
from care_sim.policies.learned.tiling import Tiling

GRID = AngularGrid(columns=4, rows=4)
RIG = Rig(GRID, budget=4)
QUARTERS = Tiling(GRID, 2, 2)
SCORES = np.array([[0.1, 0.2], [0.3, 0.4]])
NOTHING = Belief(
    Ego(),
    4,
    ImageDetections.from_rows(np.empty((0, 9))),
    Tracks.from_rows(np.empty((0, 13))),
    np.zeros((4, 4)),
)


def test_sectors_become_layers_behind_the_hulls():
    demand = reserve_demand(NOTHING, RIG, QUARTERS, SCORES)
    assert demand.exploitation == []
    assert [[cells.tolist() for cells in layer] for layer in demand.layers] == [
        [[10, 11, 14, 15]],
        [[8, 9, 12, 13]],
    ]


def test_sectors_alone_fill_the_budget_best_first():
    demand = sector_demand(RIG, QUARTERS, SCORES)
    assert allocate(demand, 4, 0.3).tolist() == [10, 11, 14, 15]
    assert sector_demand(RIG, QUARTERS, -SCORES).layers == []


def test_equal_scores_go_by_ascending_sector():
    """Also where a network is so sure that its scores are equal in float32."""
    scores = np.tanh(np.array([[12, 14], [13, 15]], np.float32))
    assert len(np.unique(scores)) == 1
    assert allocate(sector_demand(RIG, QUARTERS, scores), 4, 0.3).tolist() == [0, 1, 4, 5]
