"""The car's own motion as its software reads it."""

from dataclasses import replace

import numpy as np

from care_sim.core.types import Ego


class Odometry:
    """Reads the true motion with Gaussian noise of `speed_sigma` m/s on how fast the car is;
    without noise, as it is.

    Which way it goes is known from the gear: noise leads to standstill at most.
    """

    def __init__(self, speed_sigma: float, seed: np.random.SeedSequence):
        self._speed_sigma, self._rng = speed_sigma, np.random.default_rng(seed)

    def reading(self, motion: Ego) -> Ego:
        """What is read now. Noise never turns the way that the car goes. It is folded back at 0:
        cut there, half the readings of a standing car would be exact.
        """
        if not self._speed_sigma:
            return motion
        way = -1.0 if motion.speed < 0 else 1.0
        pace = abs(abs(motion.speed) + self._speed_sigma * self._rng.standard_normal())
        return replace(motion, speed=way * pace)
