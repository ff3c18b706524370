"""Worlds that single environments play, one after the other: all that the arrays of
`care_sim.batch` do not know.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Mask
from care_sim.envs.sensing import Observed
from care_sim.envs.vector.arguments import Maker
from care_sim.envs.vector.worlds import Stepped


class SeparateWorlds:
    """One environment, which one of `makers` makes, for every row of `observed`."""

    def __init__(self, makers: Sequence[Maker], observed: Observed):
        self.observed = observed
        self._envs = [make() for make in makers]

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, dict[str, Any]]:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        infos = {}
        for world, seed in seeds.items():
            observation, infos[world] = self._envs[world].reset(seed=seed)
            self._show(world, observation)
        return infos

    def step(self, actions: NDArray[np.float32], who: Mask) -> Stepped:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        stepped = Stepped.nothing(len(who))
        for world in np.flatnonzero(who).tolist():
            observation, reward, terminated, truncated, info = self._envs[world].step(
                actions[world]
            )
            self._show(world, observation)
            stepped.rewards[world] = reward
            stepped.terminated[world], stepped.truncated[world] = terminated, truncated
            stepped.single[world] = info
        return stepped

    def close(self) -> None:
        """Free the simulators."""
        for env in self._envs:
            env.close()

    def _show(self, world: int, observation: Observed) -> None:
        for name, values in observation.items():
            self.observed[name][world] = values
