"""Streets whose films are kept, for learners that meet the same few again and again."""

from functools import lru_cache
from typing import Any

from care_sim.envs.scenes import StreetEnv
from care_sim.envs.sensing import Observed
from care_sim.sources.street_films import street_film
from care_sim.training.draws import STREETS

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
        self._reseed(seed, options)
        film = _film(self._street, self._secret, self._setup, self.conditions.filmed)
        return self._start(film, self._draw_entropy(seed))
