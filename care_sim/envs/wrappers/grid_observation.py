"""An observation small enough for a small network: coarse pictures of the angular grid."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from care_sim.envs.sensing import sensing
from care_sim.policies.learned.grid_features import EGO_INPUTS, GridFeatures

GridArrays = dict[str, NDArray[np.float32]]


class GridObservation(gymnasium.ObservationWrapper[GridArrays, Any, Any], RecordConstructorArgs):
    """Shows the belief as six channels over `columns` x `rows` blocks of the angular grid, and the
    car's own motion.

    ### Observation
    A `Dict` of float32 vectors. `grid` is flat, since Stable-Baselines3 takes anything of three
    dimensions for a picture of bytes: `grid.reshape(6, rows, columns)` gives the channels, row 0
    highest, column 0 straight behind.

    | key | shape | bounds | content |
    |---|---|---|---|
    | `grid` | (6 * rows * columns,) | 0 to 1 | the channels below, one after the other |
    | `ego` | (4,) | -1 to 1 | speed / 30 m/s, yaw rate / 1 rad/s, acceleration / 10 m/s^2, B / N |

    | channel | a block's value |
    |---|---|
    | 0 `forecast` | share of its cells inside the dilated hull of a forecast |
    | 1 `residual` | share inside the wedge of a camera detection that no forecast explains |
    | 2 `explained` | share inside the wedge of one that a forecast does explain |
    | 3 `nearness` | 1 - r / reach of its nearest return r in the last scan; 0 without a return |
    | 4 `fired` | share fired in the last scan |
    | 5 `undetected` | share with a return 0.25 to 4 m above the road, outside all forecast hulls |

    ### Action
    That of the wrapped environment.

    ### Arguments
    `columns` (64) and `rows` (8) of blocks; each must divide the grid, 512 x 32: a block of 8 x 4
    cells is 5.6 by 5.3 degrees, about the width of a person's wedge at 15 m. Composes with the
    other wrappers in any order, since it reads the observation of the unwrapped environment, and
    nothing but it. Raises `care_sim.InvalidInput` for blocks that do not divide the grid or an
    environment that is none of CARE-Sim.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], columns: int = 64, rows: int = 8):
        self._sensing = sensing(env)
        self.features = GridFeatures(self._sensing.rig, columns, rows)
        RecordConstructorArgs.__init__(self, columns=columns, rows=rows)
        gymnasium.ObservationWrapper.__init__(self, env)
        shown: spaces.Space[Any] = spaces.Dict(
            {
                "grid": spaces.Box(0.0, 1.0, (int(np.prod(self.features.shape)),), np.float32),
                "ego": spaces.Box(-1.0, 1.0, (len(EGO_INPUTS),), np.float32),
            }
        )
        self.observation_space = shown

    def observation(self, observation: Any) -> GridArrays:
        """The pictures of what the unwrapped environment shows now."""
        return dict(self.features(self._sensing.belief))
