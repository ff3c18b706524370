"""The vehicles of one lane, each driven by the intelligent driver model (IDM), all at once.

The model (Treiber, Hennecke and Helbing 2000) and its numbers are those of highway-env's
`IDMVehicle`, which `care_sim.world.traffic` asks vehicle by vehicle. Where nobody changes lanes the
motion is the same, and a whole street costs less than one vehicle there.
"""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats

_MOST_MPS2 = 6.0
_GAINING_MPS2 = 3.0
_BRAKING_MPS2 = 5.0
STANDING_GAP_M = 10.0
"""From centre to centre."""
_TIME_GAP_S = 1.5
_EXPONENT = 4.0


class LaneFlow:
    """Vehicles that keep one lane. Places are those of their middles, metres the way they drive."""

    places: Floats
    """(n,) metres."""
    speeds: Floats
    """(n,) m/s."""

    def __init__(self, places: Sequence[float], wanted: Sequence[float]):
        """Vehicles at `places` that drive at the speeds `wanted` (m/s, above 0), and want to."""
        self.places = np.array(places, float)
        self.speeds = np.array(wanted, float)
        self._wanted = self.speeds.copy()

    def step(self, dt: float, others: Sequence[tuple[float, float]] = ()) -> None:
        """Let every driver decide, then move all by `dt` seconds. `others` are place and speed of
        what else is in the lane, such as a car that is no IDM driver's.
        """
        accelerations = self._accelerations(others)
        self.places += self.speeds * dt
        self.speeds = np.maximum(self.speeds + accelerations * dt, 0.0)

    def _accelerations(self, others: Sequence[tuple[float, float]]) -> Floats:
        """(n,) m/s^2."""
        free: Floats = 1 - (self.speeds / self._wanted) ** _EXPONENT
        # Who drives ahead of each: the nearest of all whose place is greater.
        places = np.append(self.places, [place for place, _ in others])
        speeds = np.append(self.speeds, [speed for _, speed in others])
        gaps = places - self.places[:, None]  # (n, n + others)
        gaps[gaps <= 0] = np.inf
        if not gaps.size:
            return free
        leads = np.argmin(gaps, axis=1)
        gap = gaps[np.arange(len(gaps)), leads]
        closing = self.speeds * (self.speeds - speeds[leads])
        wished = (
            STANDING_GAP_M
            + self.speeds * _TIME_GAP_S
            + closing / (2 * np.sqrt(_GAINING_MPS2 * _BRAKING_MPS2))
        )
        wanted: Floats = _GAINING_MPS2 * (free - (wished / gap) ** 2)
        return np.clip(wanted, -_MOST_MPS2, _MOST_MPS2)
