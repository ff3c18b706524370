"""An environment whose episodes differ in what they are played in. With streets whose films are
kept, and left and right exchanged.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.grid_stack import Grid
from care_sim.core.rig import Rig
from care_sim.envs.scenes import StreetEnv
from care_sim.envs.sensing import Observed, SensingEnv, sensing
from care_sim.envs.wrappers.grid_observation import GridArrays
from care_sim.policies.learned.grid_features import EGO_INPUTS
from care_sim.sources.street_films import street_film
from care_sim.training.draws import STREETS, Draw, drawn

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


# Those of the training and those of the validation.
_film = lru_cache(maxsize=2 * STREETS)(street_film)


class DrawnStreet(StreetEnv):
    """The street of the seed `street` in every episode; the seed of `reset` draws faults, noise and
    floor.
    """

    def __init__(self, street: int, **parameters: Any):
        super().__init__(**parameters)
        self._street = street

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode in the street."""
        film = _film(self._street, self._secret, self._setup, self.conditions.filmed)
        return self._start(film, self._entropy(seed, options))


_YAW_RATE = EGO_INPUTS.index("yaw_rate")
_LAST_BITS = 1e-9


class Mirrored(gymnasium.Wrapper[GridArrays, NDArray[np.float32], Any, Any]):
    """Shows the pictures of `GridObservation` reflected at the plane through the middle of the car,
    and reflects the scores of sectors back. `shape` (channels, rows, columns) is that of the
    pictures.

    So it fits every environment, and a learner meets either side as often. Raises InvalidInput for
    a LiDAR that is not the same on both sides.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], shape: tuple[int, int, int]):
        super().__init__(env)
        self._shape = shape
        if not _is_symmetric(sensing(env).rig):
            raise InvalidInput(
                "sides can be drawn only of a LiDAR that stands in the middle of the car and is "
                "alike on both"
            )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[GridArrays, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._reflected(observation), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[GridArrays, Any, bool, bool, dict[str, Any]]:
        """Go on to the next keyframe."""
        observation, reward, terminated, truncated, info = self.env.step(action[:, ::-1])
        return self._reflected(observation), reward, terminated, truncated, info

    def _reflected(self, observation: GridArrays) -> GridArrays:
        grid = observation["grid"].reshape(self._shape)[..., ::-1].ravel()
        ego = observation["ego"].copy()
        ego[_YAW_RATE] *= -1
        return {"grid": grid, "ego": ego}


def _is_symmetric(rig: Rig) -> bool:
    """Whether the grid's columns on the left are those on the right, reflected."""
    directions = rig.grid.directions.reshape(*rig.grid.shape, 3)
    reflected = directions[:, ::-1] * (1, -1, 1)
    return not rig.sensor_y_m and bool(np.abs(directions - reflected).max() < _LAST_BITS)
