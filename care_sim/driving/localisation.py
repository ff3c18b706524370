"""Pose and motion of the car as its own software believes them."""

import math
from dataclasses import replace

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import Ego


class Localisation:
    """The error of the localised pose in x, y and yaw, one of its own at every keyframe.

    Each is a first-order Gauss-Markov process (Groves, Principles of GNSS, Inertial, and
    Multisensor Integrated Navigation Systems, 2013, Sec. B.4): Gaussian with the stated spread at
    every keyframe, and correlated by exp(-t / `ego_pose_correlation_s`) over t seconds. With a time
    of 0 it is drawn anew at every keyframe. Over times far shorter than the correlation it is a
    constant error and a random walk, in steps of spread sigma sqrt(2 t / tau).
    """

    def __init__(self, sensing: Sensing, keyframe_s: float, seed: np.random.SeedSequence):
        # A stream of its own: the noise of the car's speed stays as it is.
        self._rng = np.random.default_rng(seed.spawn(1)[0])
        yaw_sigma = math.radians(sensing.ego_yaw_sigma_deg)
        self._sigmas = np.array([sensing.ego_position_sigma_m] * 2 + [yaw_sigma])
        self._is_exact = not self._sigmas.any()
        correlation_s = sensing.ego_pose_correlation_s
        self._kept = math.exp(-keyframe_s / correlation_s) if correlation_s else 0.0
        self._error = self._drawn()
        """(3,) metres along the world's x and y, and radians."""

    def advance(self) -> None:
        """Go on to the next keyframe, and to its error."""
        if not self._is_exact:
            # The forgotten part is drawn anew, so that the spread stays the same.
            new = math.sqrt(1 - self._kept**2)
            self._error = self._kept * self._error + new * self._drawn()

    def taken_for(self, frame: Frame) -> Frame:
        """Where a frame that moves with the car, at `frame` in truth, is taken to be now."""
        if self._is_exact:
            return frame
        x, y, yaw = self._error.tolist()
        return replace(frame, x=frame.x + x, y=frame.y + y, yaw=frame.yaw + yaw)

    def _drawn(self) -> Floats:
        # Three numbers whatever the spreads are: a spread scales its own and moves no other.
        return self._sigmas * self._rng.standard_normal(3)


class Odometry:
    """Reads the true motion, with Gaussian noise of `speed_sigma` m/s on how fast the car is.

    Which way the car goes is known from the gear: noise never changes the sign of the speed.
    """

    def __init__(self, speed_sigma: float, seed: np.random.SeedSequence):
        self._speed_sigma = speed_sigma
        self._rng = np.random.default_rng(seed)

    def reading(self, motion: Ego) -> Ego:
        """Return the reading of the car's true `motion` now."""
        if not self._speed_sigma:
            return motion
        # Noise is folded back at 0. If it were cut there, half the readings of a standing car would
        # be exact.
        way = -1.0 if motion.speed < 0 else 1.0
        pace = abs(abs(motion.speed) + self._speed_sigma * self._rng.standard_normal())
        return replace(motion, speed=way * pace)
