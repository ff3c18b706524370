"""Left and right change places, between the environment and who learns."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.rig import Rig
from care_sim.envs.sensing import sensing
from care_sim.envs.wrappers.grid_observation import GridArrays
from care_sim.policies.learned.grid_features import EGO_INPUTS

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
