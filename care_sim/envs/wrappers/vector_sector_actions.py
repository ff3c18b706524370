"""`SectorReserve` and `SectorScores` of many worlds at once."""

from typing import Any

import numpy as np
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from care_sim.base.vectors import attribute_of_each
from care_sim.core.arrays import Floats, Mask
from care_sim.core.observation.beliefs import Beliefs
from care_sim.core.types import Action
from care_sim.envs.spaces import checked_scores
from care_sim.envs.wrappers.reading import Reading, ReadsBeliefs, reading_inside
from care_sim.envs.wrappers.sector_actions import SectorReserve, SectorScores, sectors_space
from care_sim.envs.wrappers.vectors import AnyVector, WorldsWrapper, rig_of, shows_beliefs
from care_sim.policies.learned.sectors import SectorActions, Tiling


class _VectorSectors(WorldsWrapper):
    """One score per world and sector, from -1 to 1."""

    def __init__(self, env: AnyVector, azimuths: int = 32, elevations: int = 4):
        self._rig = rig_of(env)
        super().__init__(env)
        budgets = np.array([rig.budget for rig in attribute_of_each(env, "rig")])
        self.sectors = Tiling(self._rig.grid, azimuths, elevations)
        self._fired = SectorActions(self._rig, self.sectors, budgets)
        self.single_action_space = sectors_space(self.sectors)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def step(self, actions: NDArray[np.float32]) -> tuple[Any, Floats, Mask, Mask, dict[str, Any]]:
        """Fire what the scores `actions` (W, elevations, azimuths) make of the grid and go on to
        the next keyframe.
        """
        scores = checked_scores(actions, (self.num_envs, *self.sectors.shape))
        return self.env.step(self._cells(scores))

    def _cells(self, scores: NDArray[np.float32]) -> Action:
        """Scores (W, E, A) of the cells that the shared allocator takes, until the next call."""
        raise NotImplementedError


class VectorSectorReserve(_VectorSectors, ReadsBeliefs):
    """`SectorReserve` over a vector environment: a world is the single environment behind
    `SectorReserve`, to the last bit.

    ### Action
    That of `SectorReserve`, a row for every world: `Box(-1, 1, (W, elevations, azimuths),
    float32)`.

    ### Observation
    That of the wrapped vector environment, unchanged. The forecasts are read from it, or, outside
    `VectorGridObservation`, they are those that its pictures were drawn of.

    ### Arguments
    As of `SectorReserve`.

    ### Example
    ```python
    env = VectorSectorReserve(gymnasium.make_vec("CARE-Dense-v0", num_envs=4, budget=0.03))
    observation, info = env.reset(seed=0)
    scores = np.zeros(env.action_space.shape, np.float32)  # (4, 4, 32)
    scores[:, 1, 16] = 1.0  # in every world the sector just left of ahead
    observation, rewards, terminated, truncated, infos = env.step(scores)
    ```
    """

    single = SectorReserve

    def __init__(self, env: AnyVector, azimuths: int = 32, elevations: int = 4):
        super().__init__(env, azimuths, elevations)
        inside = None if shows_beliefs(env) else reading_inside(env, "VectorSectorReserve")
        self.reading = Reading(self._rig, Beliefs.from_observation, inside)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observation, infos = self.env.reset(seed=seed, options=options)
        self.reading.take(observation)
        return observation, infos

    def step(self, actions: NDArray[np.float32]) -> tuple[Any, Floats, Mask, Mask, dict[str, Any]]:
        """As `VectorSectorReserve` says."""
        answer = super().step(actions)
        self.reading.take(answer[0])
        return answer

    def _cells(self, scores: NDArray[np.float32]) -> Action:
        return self._fired.reserve(self.reading.beliefs, scores)


class VectorSectorScores(_VectorSectors):
    """`SectorScores` over a vector environment: a world is the single environment behind
    `SectorScores`, to the last bit.

    ### Action
    That of `SectorScores`, a row for every world: `Box(-1, 1, (W, elevations, azimuths), float32)`.

    ### Observation
    That of the wrapped vector environment.

    ### Arguments
    As of `SectorReserve`.

    ### Example
    ```python
    envs = gymnasium.make_vec("CARE-Dense-v0", num_envs=4, budget=0.03)
    env = VectorSectorScores(envs, azimuths=16, elevations=2)
    env.reset(seed=0)
    observation, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
    infos["fired"]  # (4, 492) the cells that were fired
    ```
    """

    single = SectorScores

    def _cells(self, scores: NDArray[np.float32]) -> Action:
        return self._fired.alone(scores)
