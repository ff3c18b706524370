"""An observation small enough for a small network: coarse pictures of the angular grid."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from care_sim.base.checks import check_flag
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import OBSERVED, Observation
from care_sim.core.beliefs import Beliefs
from care_sim.core.rig import Rig
from care_sim.envs.sensing import sensing
from care_sim.envs.wrappers.reading import (
    AnyVector,
    Reading,
    ReadsBeliefs,
    WorldsWrapper,
    reading_of,
    rig_of,
    shows_belief,
)
from care_sim.policies.learned.grid_features import EGO_INPUTS, GridFeatures

GridArrays = dict[str, NDArray[np.float32]]


class _Pictures(ReadsBeliefs):
    """Beliefs as pictures, those of an environment or of the worlds of a vector."""

    def _lay(
        self,
        env: gymnasium.Env[Any, Any] | AnyVector,
        rig: Rig,
        columns: int,
        rows: int,
        pictures: bool,
    ) -> spaces.Space[Any]:
        """Lay the blocks of the pictures, and return the space of those of a world."""
        check_flag("pictures", pictures)
        if not shows_belief(env):
            raise InvalidInput(
                f"{type(self).__name__} needs the observation of CARE-Sim's environments, with "
                f"{', '.join(OBSERVED)}; {shown(env)} shows another"
            )
        self.features = GridFeatures(rig, columns, rows)
        # Nothing stands between it and a wrapper that it is put around at once.
        self.reading = Reading(env, rig, reading_of(env))
        shape = self.features.shape
        self._shape = shape if pictures else (int(np.prod(shape)),)
        return spaces.Dict(
            {
                "grid": spaces.Box(0.0, 1.0, self._shape, np.float32),
                "ego": spaces.Box(-1.0, 1.0, (len(EGO_INPUTS),), np.float32),
            }
        )

    def _drawn(self, beliefs: Beliefs) -> GridArrays:
        """Observations of W worlds, with pictures (W, ...)."""
        told = self.features.of_all(beliefs)
        return told | {"grid": told["grid"].reshape(-1, *self._shape)}


class GridObservation(
    _Pictures, gymnasium.ObservationWrapper[GridArrays, Any, Any], RecordConstructorArgs
):
    """Shows the belief as coarse pictures of the angular grid, and the car's own motion.

    The pictures are six channels over `columns` x `rows` blocks of the grid.

    ### Observation
    A `Dict` of float32 vectors. `grid` is flat, as networks without convolutions take it: with
    `pictures` it has the shape (6, rows, columns), channels first, the same numbers in the same
    order. Row 0 is highest, column 0 straight behind.

    | key | shape | bounds | content |
    |---|---|---|---|
    | `grid` | (6 * rows * columns,), or (6, rows, columns) | 0 to 1 | the channels below |
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
    `columns` (64) and `rows` (8) of blocks; each must divide the grid, 512 x 32. A block of 8 x 4
    cells is 5.6 by 5.3 degrees, about the width of a person's wedge at 15 m. `pictures` (False)
    gives `grid` its three dimensions.

    It draws the observation that it is given and reads nothing else. A wrapper between it and the
    environment therefore counts: one that hides a detection hides it in the pictures. Such a
    wrapper must show an observation of the same form. `SectorReserve` and `SectorScores` may stand
    inside or outside.

    Raises `care_sim.InvalidInput` for blocks that do not divide the grid and for an observation
    that no sensor can give. Raises it also for an environment that is none of CARE-Sim or shows
    another form of observation.

    ### Example
    ```python
    env = SectorReserve(gymnasium.make("CARE-Dense-v0", budget=0.03))
    env = GridObservation(env, pictures=True)

    observation, info = env.reset(seed=0)
    forecasts = observation["grid"][0]  # (8, 64), row 0 highest, column 0 straight behind
    observation["ego"]  # (4,) the car's own motion and the budget
    ```
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        columns: int = 64,
        rows: int = 8,
        pictures: bool = False,
    ):
        space = self._lay(env, sensing(env).rig, columns, rows, pictures)
        RecordConstructorArgs.__init__(self, columns=columns, rows=rows, pictures=pictures)
        gymnasium.ObservationWrapper.__init__(self, env)
        self.observation_space = space

    def observation(self, observation: Observation) -> GridArrays:
        """The pictures of the observation that was given. Raises InvalidInput for another form."""
        self.reading.take(observation)
        return {name: rows[0] for name, rows in self._drawn(self.reading.beliefs).items()}


class VectorGridObservation(_Pictures, WorldsWrapper):
    """`GridObservation` over a vector environment: what it shows of a world is what
    `GridObservation` shows of the single environment, to the last bit.

    It takes every mode of `autoreset_mode`; in "SameStep" the last observations of episodes, in
    `infos["final_obs"]`, are pictures, too.

    Observation and arguments are those of `GridObservation`, a row for every world. The arrays are
    the caller's own, also where those of the wrapped environment are written over by its next step
    (`copy=False`).

    ### Example
    ```python
    envs = gymnasium.make_vec("CARE-Dense-v0", num_envs=4, budget=0.03)
    env = VectorGridObservation(VectorSectorReserve(envs), pictures=True)
    observation, info = env.reset(seed=0)
    forecasts = observation["grid"][:, 0]  # (4, 8, 64)
    ```
    """

    single = GridObservation

    def __init__(self, env: AnyVector, columns: int = 64, rows: int = 8, pictures: bool = False):
        self._rig = rig_of(env)
        WorldsWrapper.__init__(self, env)
        self.single_observation_space = self._lay(env, self._rig, columns, rows, pictures)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[GridArrays, dict[str, Any]]:
        """Begin episodes."""
        observation, infos = self.env.reset(seed=seed, options=options)
        return self._shown(observation), infos

    def step(self, actions: Any) -> tuple[GridArrays, Floats, Mask, Mask, dict[str, Any]]:
        """Advance to the next keyframe."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        if "final_obs" in infos:
            infos = infos | {"final_obs": self._finals(infos["final_obs"])}
        return self._shown(observation), rewards, terminated, truncated, infos

    def _shown(self, observation: Observation) -> GridArrays:
        self.reading.take(observation)
        return self._drawn(self.reading.beliefs)

    def _finals(self, given: Sequence[Any]) -> NDArray[np.object_]:
        """(W,) pictures of the last observations of those worlds that have one, else None."""
        over = [world for world, last in enumerate(given) if last is not None]
        stacked = {name: np.stack([given[world][name] for world in over]) for name in OBSERVED}
        drawn = self._drawn(Beliefs.from_observation(stacked, self._rig))
        finals = np.full(len(given), None, object)
        for row, world in enumerate(over):
            finals[world] = {name: rows[row] for name, rows in drawn.items()}
        return finals
