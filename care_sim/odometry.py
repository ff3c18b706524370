"""The car's own motion as its software reads it."""

from dataclasses import replace

import numpy as np

from care_sim.types import Ego


class Odometry:
    """Reads the true motion with Gaussian noise of `speed_sigma` m/s on the speed; without noise, as it is."""

    def __init__(self, speed_sigma: float, seed: np.random.SeedSequence):
        self._speed_sigma, self._rng = speed_sigma, np.random.default_rng(seed)

    def reading(self, motion: Ego) -> Ego:
        """What is read now. No sign is read: cut at 0, half the readings of a standing car would be exact."""
        if not self._speed_sigma:
            return motion
        return replace(motion, speed=abs(motion.speed + self._speed_sigma * self._rng.standard_normal()))
