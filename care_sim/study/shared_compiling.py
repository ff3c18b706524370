"""Share the compiling of the simulator between the workers of a machine's first study."""

from typing import cast

import numpy as np
from gymnasium.vector.utils import create_empty_array

from care_sim.base.compiled import lacks_code
from care_sim.batch import sight
from care_sim.batch.loop import BatchLoop
from care_sim.batch.state import place_sensors
from care_sim.core.arrays import Mask
from care_sim.envs.sensing import Observed
from care_sim.study.episode_config import EpisodeConfig, closed_loop


def is_compiling_due() -> bool:
    """Return True if the simulator can be compiled for later processes, but is not yet."""
    return lacks_code(sight._look)


def compile_from_the_end() -> None:
    """Play a keyframe that fires first and looks last.

    Episodes look first. Workers that begin together compile the same stages at the same time. One
    worker that begins with this keyframe compiles the other half, and each reads what the other
    has compiled.
    """
    with EpisodeConfig("dartout", "care").make_env() as env:
        model = closed_loop(env)
        observed = cast(Observed, create_empty_array(model.observation_space, 1))
        duration_s = model.scenario.duration_s
        loop = _LooksLast([model.rig], [model.conditions], duration_s, observed, exact=False)
        try:
            loop.begin({0: model.episode(0)})
            loop.keyframe(observed["ranges"], np.ones(1, np.bool_))
        finally:
            loop.close()


class _LooksLast(BatchLoop):
    """A loop whose first pictures are those after its first keyframe."""

    def _look(self, who: Mask) -> None:
        if self.state.keyframes.any():
            super()._look(who)
        else:
            place_sensors(self.state, self._rig.sensor_position)
