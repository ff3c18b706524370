"""Actions of a few numbers instead of one per cell: scores of azimuth x elevation sectors."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from care_sim.core.actions import scores_of
from care_sim.core.allocation import allocate
from care_sim.core.types import Action, Demand
from care_sim.envs.sensing import sensing
from care_sim.envs.spaces import checked_scores
from care_sim.policies.learned.sector_demand import reserve_demand, sector_demand
from care_sim.policies.learned.tiling import Tiling


class _Sectors(gymnasium.ActionWrapper[Any, NDArray[np.float32], Action], RecordConstructorArgs):
    """One score per sector, from -1 to 1: the range that learners are made for."""

    def __init__(self, env: gymnasium.Env[Any, Any], azimuths: int = 32, elevations: int = 4):
        self._sensing = sensing(env)
        self.sectors = Tiling(self._sensing.rig.grid, azimuths, elevations)
        RecordConstructorArgs.__init__(self, azimuths=azimuths, elevations=elevations)
        gymnasium.ActionWrapper.__init__(self, env)
        self.action_space = spaces.Box(-1.0, 1.0, self.sectors.shape, np.float32)

    def _cells(self, demand: Demand) -> Action:
        """Scores (E, A) of the cells that the shared allocator takes."""
        rig = self._sensing.rig
        return scores_of(allocate(demand, rig.budget, rig.reserve_fraction), rig.grid.shape)


class SectorReserve(_Sectors):
    """The action ranks sectors for the reserve; exploitation and floor stay those of the shared
    allocator.

    So a learner competes with the rules on the reserve alone.

    ### Action
    `Box(-1, 1, (elevations, azimuths), float32)`, one score per sector; elevation 0 is the highest,
    azimuth 0 begins straight behind.

    | score | what happens to the sector |
    |---|---|
    | above 0 | a layer of the reserve; highest score first, ties by ascending index |
    | 0 or less | left to the floor |

    The hulls of the forecasts, nearest first, take at most round((1 - rho) B) cells (Algorithm 1),
    then sector after sector is fired whole, cells ascending, up to B, then the floor. Zeros
    everywhere are the `history` policy, cell for cell.

    ### Observation
    That of the wrapped environment.

    ### Arguments
    `azimuths` (32) and `elevations` (4), which must divide the grid, 512 x 32: a sector is 16 x 8
    cells, 11.25 by 10.7 degrees; of the reserve of 3%, 148 cells, it takes 128. Raises
    `care_sim.InvalidInput` for other numbers, for an action of another shape or with values that
    are not finite, or an environment that is none of CARE-Sim.
    """

    def action(self, action: NDArray[np.float32]) -> Action:
        """Scores (E, A) of the cells that the shared allocator takes."""
        scores = checked_scores(action, self.sectors.shape)
        return self._cells(
            reserve_demand(self._sensing.belief, self._sensing.rig, self.sectors, scores)
        )


class SectorScores(_Sectors):
    """The action scores everything: sector after sector is fired whole, best first, up to the
    budget.

    ### Action
    `Box(-1, 1, (elevations, azimuths), float32)`, one score per sector; elevation 0 is the highest,
    azimuth 0 begins straight behind.

    | score | what happens to the sector |
    |---|---|
    | above 0 | its cells fire, ascending; highest score first, ties by ascending index |
    | 0 or less | left to the floor |

    ### Observation
    That of the wrapped environment.

    ### Arguments
    As of `SectorReserve`.
    """

    def action(self, action: NDArray[np.float32]) -> Action:
        """Scores (E, A) of the cells that the shared allocator takes."""
        return self._cells(
            sector_demand(
                self._sensing.rig, self.sectors, checked_scores(action, self.sectors.shape)
            )
        )
