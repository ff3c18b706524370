"""`GridObservation` of many worlds at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from care_sim.base.checks import check_flag
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import OBSERVED, Observation
from care_sim.core.observation.beliefs import Beliefs
from care_sim.envs.wrappers.grid_observation import (
    GridArrays,
    GridObservation,
    grid_shape,
    grid_space,
    shaped,
)
from care_sim.envs.wrappers.reading import Reading, ReadsBeliefs, reading_of
from care_sim.envs.wrappers.vectors import AnyVector, WorldsWrapper, rig_of, shows_beliefs
from care_sim.policies.learned.grid_features import GridFeatures


class VectorGridObservation(WorldsWrapper, ReadsBeliefs):
    """`GridObservation` over a vector environment: what it shows of a world is what
    `GridObservation` shows of the single environment, to the last bit.

    It takes every mode of `autoreset_mode`; in "SameStep" the last observations of episodes, in
    `infos["final_obs"]`, are pictures, too.

    ### Action
    That of the wrapped vector environment.

    ### Observation
    The `Dict` of `GridObservation`, a row for every world: `grid` (W, 6 * rows * columns), or with
    `pictures` (W, 6, rows, columns), and `ego` (W, 4). The arrays are the caller's own, also where
    those of the wrapped environment are written over by its next step (`copy=False`).

    ### Arguments
    As of `GridObservation`.

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
        check_flag("pictures", pictures)
        self._rig = rig_of(env)
        if not shows_beliefs(env):
            raise InvalidInput(
                "VectorGridObservation needs the observation of CARE-Sim's environments, with "
                f"{', '.join(OBSERVED)}; {shown(env)} shows another"
            )
        super().__init__(env)
        self.features = GridFeatures(self._rig, columns, rows)
        # Nothing stands between it and a wrapper that it is put around at once.
        self.reading = Reading(self._rig, Beliefs.from_observation, reading_of(env))
        self._shape = grid_shape(self.features, pictures)
        self.single_observation_space = grid_space(self._shape)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[GridArrays, dict[str, Any]]:
        """Begin episodes."""
        observation, infos = self.env.reset(seed=seed, options=options)
        return self._shown(observation), infos

    def step(self, actions: Any) -> tuple[GridArrays, Floats, Mask, Mask, dict[str, Any]]:
        """Go on to the next keyframe."""
        observation, rewards, terminated, truncated, infos = self.env.step(actions)
        if "final_obs" in infos:
            infos = infos | {"final_obs": self._finals(infos["final_obs"])}
        return self._shown(observation), rewards, terminated, truncated, infos

    def _shown(self, observation: Observation) -> GridArrays:
        self.reading.take(observation)
        return shaped(self.features.of_all(self.reading.beliefs), self._shape)

    def _finals(self, given: Sequence[Any]) -> NDArray[np.object_]:
        """(W,) pictures of the last observations of those worlds that have one, else None."""
        over = [world for world, last in enumerate(given) if last is not None]
        stacked = {name: np.stack([given[world][name] for world in over]) for name in OBSERVED}
        last = Beliefs.from_observation(stacked, self._rig)
        drawn = shaped(self.features.of_all(last), self._shape)
        finals = np.full(len(given), None, object)
        for row, world in enumerate(over):
            finals[world] = {name: rows[row] for name, rows in drawn.items()}
        return finals
