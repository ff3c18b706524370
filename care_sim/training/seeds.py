"""Which seeds are for what, disjoint by construction.

| seeds | for |
|---|---|
| 0 to 1,999 | the benchmark; of streets 0 to 149 for evaluation, 1,000 to 1,019 for calibration |
| 2,000 to 9,999 | validation: the learning curve, and which weights are kept |
| 10,000 and up | training |

No training episode can have a seed below 10,000, whatever `--seed` is, and nothing is chosen by a
seed below 2,000. Where episodes differ by the recording and not by the seed (`CARE-Replay-v0`),
hold out recordings.
"""

from typing import Any

import gymnasium
import numpy as np

from care_sim.base.errors import InvalidInput

VALIDATION = 2_000
TRAINING = 10_000
LAST = 2**31 - 1
"""Training seeds lie below it."""


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
