"""What scores of sectors ask of the allocator."""

import numpy as np
from numpy.typing import NDArray

from care_sim.core.belief import Belief
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.learned.tiling import Tiling


def reserve_demand(
    belief: Belief, rig: Rig, sectors: Tiling, scores: NDArray[np.floating]
) -> Demand:
    """The forecasts' hulls, then the sectors with a positive score as layers of the reserve, best
    first.

    Twice the budget is enough of them: at most one budget of cells lies in the hulls already.
    """
    layers = [[cells] for cells in sectors.ranked(scores, 2 * rig.budget)]
    return Demand(rig.hulls(belief.tracks.boxes), layers)


def sector_demand(rig: Rig, sectors: Tiling, scores: NDArray[np.floating]) -> Demand:
    """The sectors with a positive score alone, best first."""
    return Demand(layers=[[cells] for cells in sectors.ranked(scores, rig.budget)])
