"""Actions of a few numbers instead of one per cell: scores of azimuth x elevation sectors."""

from abc import abstractmethod
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from care_sim.base.vectors import attribute_of_each
from care_sim.core.rig import Rig
from care_sim.core.types import Action
from care_sim.envs.sensing import checked_scores, sensing
from care_sim.envs.wrappers.reading import (
    AnyVector,
    Reading,
    ReadsBeliefs,
    WorldsWrapper,
    reading_inside,
    rig_of,
    shows_belief,
)
from care_sim.policies.learned.sectors import SectorActions, Tiling


class _Sectors:
    """One score per sector and world, from -1 to 1: the range that learners are made for."""

    env: Any

    def _lay(
        self, rig: Rig, budgets: list[int], azimuths: int, elevations: int
    ) -> spaces.Space[Any]:
        """Lay the sectors of worlds with these budgets, and return the space of their scores."""
        self._rig = rig
        self.sectors = Tiling(rig.grid, azimuths, elevations)
        self._fired = SectorActions(rig, self.sectors, np.array(budgets))
        return spaces.Box(-1.0, 1.0, self.sectors.shape, np.float32)

    @abstractmethod
    def action(self, action: NDArray[np.float32]) -> Action:
        """Scores of the cells that the shared allocator takes."""

    def _stepped(self, action: NDArray[np.float32]) -> Any:
        return self.env.step(self.action(action))

    def _cells(self, scores: NDArray[np.float32]) -> Action:
        """Scores (W, E, A) of the cells that the shared allocator takes, until the next call."""
        return self._fired.alone(scores)


class _Reserve(_Sectors, ReadsBeliefs):
    """Scores that rank the sectors for the reserve, beside the hulls of the forecasts."""

    def _read(self, env: gymnasium.Env[Any, Any] | AnyVector) -> None:
        inside = None if shows_belief(env) else reading_inside(env, type(self).__name__)
        self.reading = Reading(env, self._rig, inside)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode, in a vector one in every world."""
        answer = self.env.reset(seed=seed, options=options)
        self.reading.take(answer[0])
        return answer

    def _stepped(self, action: NDArray[np.float32]) -> Any:
        answer = super()._stepped(action)
        self.reading.take(answer[0])
        return answer

    def _cells(self, scores: NDArray[np.float32]) -> Action:
        return self._fired.reserve(self.reading.beliefs, scores)


class _SingleSectors(
    _Sectors, gymnasium.ActionWrapper[Any, NDArray[np.float32], Action], RecordConstructorArgs
):
    """Scores of the sectors of an environment."""

    def __init__(self, env: gymnasium.Env[Any, Any], azimuths: int = 32, elevations: int = 4):
        rig = sensing(env).rig
        space = self._lay(rig, [rig.budget], azimuths, elevations)
        RecordConstructorArgs.__init__(self, azimuths=azimuths, elevations=elevations)
        gymnasium.ActionWrapper.__init__(self, env)
        self.action_space = space

    def action(self, action: NDArray[np.float32]) -> Action:
        """Scores (E, A) of the cells that the shared allocator takes."""
        scores = checked_scores(action, self.sectors.shape)
        # A copy: the caller may keep it.
        cells: Action = self._cells(scores[None])[0].copy()
        return cells


class SectorReserve(_Reserve, _SingleSectors):
    """The action ranks sectors for the reserve.

    Exploitation and floor stay those of the shared allocator, so a learner competes with the rules
    on the reserve alone.

    ### Action
    `Box(-1, 1, (elevations, azimuths), float32)`, one score per sector; elevation 0 is the highest,
    azimuth 0 begins straight behind.

    | score | what happens to the sector |
    |---|---|
    | above 0 | a layer of the reserve; highest score first, ties by ascending index |
    | 0 or less | left to the floor |

    The hulls of the forecasts, nearest first, take at most round((1 - rho) B) cells (Algorithm 1).
    Then sector after sector fires whole, cells ascending, up to B. The floor fires last. Zeros
    everywhere are the `history` policy, cell for cell.

    ### Observation
    That of the wrapped environment, unchanged. The forecasts are read from it, so a wrapper between
    this one and the environment counts: if it hides a track, that track has no hull. Outside
    `GridObservation`, which shows no forecasts, they are those that its pictures were drawn of.

    ### Arguments
    `azimuths` (32) and `elevations` (4), which must divide the grid, 512 x 32. A sector is 16 x 8
    cells, 11.25 by 10.7 degrees. A sector takes 128 of the 148 cells of the reserve at 3%.

    Raises `care_sim.InvalidInput` for other numbers, and for an action of another shape or with
    values that are not finite. Raises it also for an environment that is none of CARE-Sim or whose
    observation lacks the forecasts.

    ### Example
    ```python
    env = SectorReserve(gymnasium.make("CARE-Dense-v0", budget=0.03))

    observation, info = env.reset(seed=0)
    scores = np.zeros(env.action_space.shape, np.float32)
    scores[1, 16] = 1.0  # one sector: just left of ahead, from level to 9 degrees down
    observation, reward, terminated, truncated, info = env.step(scores)
    ```
    """

    def __init__(self, env: gymnasium.Env[Any, Any], azimuths: int = 32, elevations: int = 4):
        super().__init__(env, azimuths, elevations)
        self._read(env)

    def step(self, action: NDArray[np.float32]) -> Any:
        """Fire the scores that `action` makes and advance to the next keyframe."""
        return self._stepped(action)


class SectorScores(_SingleSectors):
    """The action scores everything: sectors are fired whole, best first, up to the budget.

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

    ### Example
    ```python
    env = SectorScores(gymnasium.make("CARE-Dense-v0", budget=0.03), azimuths=16, elevations=2)
    env.reset(seed=0)
    scores = env.action_space.sample()  # (2, 16), one score per sector
    observation, reward, terminated, truncated, info = env.step(scores)
    info["fired"]  # the 492 cells that were fired
    ```
    """


class _VectorSectors(_Sectors, WorldsWrapper):
    """Scores of the sectors of every world."""

    def __init__(self, env: AnyVector, azimuths: int = 32, elevations: int = 4):
        rig = rig_of(env)
        WorldsWrapper.__init__(self, env)
        budgets = [each.budget for each in attribute_of_each(env, "rig")]
        self.single_action_space = self._lay(rig, budgets, azimuths, elevations)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def action(self, action: NDArray[np.float32]) -> Action:
        """Scores (W, E, A) of the cells that the shared allocator takes, until the next call."""
        return self._cells(checked_scores(action, (self.num_envs, *self.sectors.shape)))

    def step(self, actions: NDArray[np.float32]) -> Any:
        """Fire the cells of the scores `actions` (W, elevations, azimuths) and advance to the next
        keyframe.
        """
        return self._stepped(actions)


class VectorSectorReserve(_Reserve, _VectorSectors):
    """`SectorReserve` over a vector environment: a world is the single environment behind
    `SectorReserve`, to the last bit.

    Action, observation and arguments are those of `SectorReserve`, a row for every world.

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
        self._read(env)


class VectorSectorScores(_VectorSectors):
    """`SectorScores` over a vector environment: a world is the single environment behind
    `SectorScores`, to the last bit.

    Action, observation and arguments are those of `SectorScores`, a row for every world.

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
