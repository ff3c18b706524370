"""The car's own motion as its software reads it."""

from dataclasses import replace

import numpy as np

from care_sim.core.types import Ego


class Odometry:
    """Reads the true motion, with Gaussian noise of `speed_sigma` m/s on how fast the car is.

    Which way the car goes is known from the gear: noise never changes the sign of the speed.
    """

    def __init__(self, speed_sigma: float, seed: np.random.SeedSequence):
        self._speed_sigma = speed_sigma
        self._rng = np.random.default_rng(seed)

    def reading(self, motion: Ego) -> Ego:
        """What is read of the car's true `motion` now."""
        if not self._speed_sigma:
            return motion
        # Noise is folded back at 0. If it were cut there, half the readings of a standing car would
        # be exact.
        way = -1.0 if motion.speed < 0 else 1.0
        pace = abs(abs(motion.speed) + self._speed_sigma * self._rng.standard_normal())
        return replace(motion, speed=way * pace)
