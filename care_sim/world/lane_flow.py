"""The vehicles of one lane, each driven by the intelligent driver model (IDM), all at once.

The model (Treiber, Hennecke and Helbing 2000) and its numbers are those of highway-env's
`IDMVehicle`, which `care_sim.world.traffic` asks vehicle by vehicle. Where nobody changes lanes the
motion is the same, and a whole street costs less than one vehicle there.
"""

import math
from collections.abc import Sequence

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats

MOST_MPS2 = 6.0
GAINING_MPS2 = 3.0
BRAKING_MPS2 = 5.0
STANDING_GAP_M = 10.0
"""From centre to centre, what an IDM driver leaves before what stands ahead."""
TIME_GAP_S = 1.5
EXPONENT = 4.0


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
        # The power is NumPy's, as compiled code may round it differently.
        free = 1 - (self.speeds / self._wanted) ** EXPONENT
        ahead = np.array(others, float).reshape(-1, 2)
        return np.asarray(_following(free, self.places, self.speeds, ahead))


@compiled(error_model="numpy")
def _following(free: Floats, places: Floats, speeds: Floats, others: Floats) -> Floats:
    """(n,) the accelerations of drivers at `places` with `speeds`, who follow each other and
    `others` (m, 2), places and speeds. `free` are the shares of their acceleration that each would
    take on a free road.
    """
    accelerations = np.empty(len(places))
    for n in range(len(places)):
        # Who drives ahead: the nearest of all whose place is greater, of equally near ones the
        # first.
        gap, lead_mps = math.inf, 0.0
        for other in range(len(places)):
            apart = places[other] - places[n]
            if 0.0 < apart < gap:
                gap, lead_mps = apart, speeds[other]
        for other in range(len(others)):
            apart = others[other, 0] - places[n]
            if 0.0 < apart < gap:
                gap, lead_mps = apart, others[other, 1]
        closing = speeds[n] * (speeds[n] - lead_mps)
        wished = (
            STANDING_GAP_M
            + speeds[n] * TIME_GAP_S
            + closing / (2 * math.sqrt(GAINING_MPS2 * BRAKING_MPS2))
        )
        wanted = GAINING_MPS2 * (free[n] - (wished / gap) ** 2)
        accelerations[n] = min(max(wanted, -MOST_MPS2), MOST_MPS2)
    return accelerations
