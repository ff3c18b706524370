"""Episodes of training and of validation seeds alone (`care_sim.base.seed_ranges`)."""

from typing import Any

import gymnasium
import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.seed_ranges import LAST, TRAINING, VALIDATION


class TrainingSeeds(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Every reset begins an episode of a training seed.

    The learner's seed and the one given to `reset` decide the sequence of them.

    Stable-Baselines3 counts the seed of `reset` up from environment to environment. Without the
    learner's, learners of neighbouring seeds would share most of their episodes.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], learner: int = 0):
        super().__init__(env)
        self._learner = learner
        self._rng = np.random.default_rng()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode."""
        if seed is not None:
            self._rng = np.random.default_rng((seed, self._learner))
        return self.env.reset(seed=int(self._rng.integers(TRAINING, LAST)), options=options)


def validation_seeds(episodes: int) -> range:
    """The first `episodes` seeds of the validation. Raises InvalidInput for more than there are."""
    if episodes > TRAINING - VALIDATION:
        raise InvalidInput(
            f"episodes must be at most {TRAINING - VALIDATION}, the validation seeds, got "
            f"{episodes}"
        )
    return range(VALIDATION, VALIDATION + episodes)
