"""An environment whose episodes differ in what they are played in."""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium

from care_sim.base.errors import InvalidInput
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.envs.sensing import SensingEnv, sensing
from care_sim.training.draws import Draw, drawn

AnyEnv = gymnasium.Env[Any, Any]


class DrawnEnv(gymnasium.Env[Any, Any]):
    """Every reset draws an episode (`care_sim.training.draws`) and makes the environment for it
    with `make`, whose spaces and errors it has.

    `unwrapped` and `rig` are those of the running episode; before the first one, of an episode of
    the first environment. Raises InvalidInput at once for what is wrong with any of the
    environments, and for LiDARs that differ.
    """

    def __init__(
        self,
        make: Callable[[Draw], AnyEnv],
        places: int,
        budgets: Sequence[float],
        faulty: bool = True,
    ):
        self._make = make
        self._given = places, budgets, faulty
        grids = list[Grid]()
        # Mirrored, since not every sensor can be. The first one last: its spaces stay.
        for place in reversed(range(places)):
            for budget in budgets:
                self._env = make(Draw(place, budget, {}, True, 0, 0))
                self._env.close()
            grids.append(self.rig.grid)
        # What is kept is of one grid, and its card tells that of the last episode.
        if any(grid != grids[0] for grid in grids):
            raise InvalidInput("episodes can be drawn only of environments with the same LiDAR")
        self._follow()

    @property
    def unwrapped(self) -> SensingEnv[Any]:
        """The environment of the running episode, without its wrappers."""
        return sensing(self._env)

    @property
    def rig(self) -> Rig:
        """That of the running episode."""
        return self.unwrapped.rig

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the episode that a seed draws; without one, that of a number drawn from the last.

        Raises InvalidInput for a seed of no split.
        """
        super().reset(seed=seed)
        own = int(self.np_random.integers(2**31 - 1)) if seed is None else int(seed)
        draw = drawn(own, *self._given)
        self._env.close()
        self._env = self._make(draw)
        self._follow()
        return self._env.reset(seed=draw.seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Go on to the next keyframe."""
        return self._env.step(action)

    def close(self) -> None:
        """Free the simulator."""
        self._env.close()

    def _follow(self) -> None:
        # Environments have cameras of their own, and what they show has other bounds; behind the
        # wrappers of learners all spaces are the same.
        self.observation_space = self._env.observation_space
        self.action_space = self._env.action_space
