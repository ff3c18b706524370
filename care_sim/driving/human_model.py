"""The competent and careful human driver of UN Regulation 157: its numbers, and how it brakes.

Annex 3 of the 01 series of amendments (Annex 4, Appendix 3, of the original text of 2021) states
them in its Table 1 and in the section on cutting in. The driver perceives a vehicle that leaves the
middle of its lane, evaluates the risk, and after a delay brakes harder and harder up to a limit.

The table's last line, 0.85 g after both vehicles overlap fully, is that of an emergency braking
system (UN Regulation 152), no driver's; it is left out, as in the Joint Research Centre's program
of the model (github.com/ec-jrc/JRC-FSM).
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats

_STANDARD_GRAVITY = 9.80665
"""m/s^2, by definition (ISO 80000-3)."""


@dataclass(frozen=True)
class HumanModel:
    """The numbers of the model. Metres, seconds."""

    lane_m: float = 3.5
    """Width of a lane: with cars of 1.9 m it leaves the 1.6 m between their sides that the Joint
    Research Centre's program starts from.
    """
    wander_m: float = 0.375
    """How far the middle of a vehicle may be off the middle of its lane before it is perceived as
    cutting in (Table 1).
    """
    evaluation_s: float = 0.4
    """Risk evaluation time, from there to the perceived risk (Table 1)."""
    danger_s: float = 2.0
    """Time to collision up to which there is a danger ahead (cut-in scenario)."""
    delay_s: float = 0.75
    """From having finished perception until deceleration starts (Table 1)."""
    brake_mps2: float = 0.774 * _STANDARD_GRAVITY
    """Full deceleration: 0.774 g (Table 1)."""
    jerk_s: float = 0.6
    """Time to full deceleration (Table 1): 12.65 m/s^3."""

    @property
    def jerk_mps3(self) -> float:
        """Growth of the deceleration, m/s^3."""
        return self.brake_mps2 / self.jerk_s

    def speed_lost(self, since_danger_s: Floats) -> Floats:
        """(n,) how much slower the car is, m/s, (n,) seconds after the danger was perceived."""
        growing, full = self._braking_times(since_danger_s)
        return self.jerk_mps3 * growing**2 / 2 + self.brake_mps2 * full

    def distance_saved(self, since_danger_s: Floats) -> Floats:
        """(n,) by how much less the car has come, m, than at even speed, (n,) seconds after the
        danger was perceived.
        """
        # While the deceleration is full, the speed lost by then counts all the time.
        growing, full = self._braking_times(since_danger_s)
        lost_before = self.jerk_mps3 * growing**2 / 2
        return self.jerk_mps3 * growing**3 / 6 + lost_before * full + self.brake_mps2 * full**2 / 2

    def time_to_lose(self, speed: Floats) -> Floats:
        """(n,) seconds from the perceived danger until the car is (n,) m/s slower."""
        ramp_mps = self.jerk_mps3 * self.jerk_s**2 / 2
        growing = np.sqrt(2 * np.minimum(speed, ramp_mps) / self.jerk_mps3)
        return self.delay_s + growing + np.maximum(speed - ramp_mps, 0.0) / self.brake_mps2

    def _braking_times(self, since_danger_s: Floats) -> tuple[Floats, Floats]:
        """For how long the deceleration has grown by then, and for how long it has been full."""
        braking = np.maximum(since_danger_s - self.delay_s, 0.0)
        return np.minimum(braking, self.jerk_s), np.maximum(braking - self.jerk_s, 0.0)


HUMAN_MODEL = HumanModel()
"""The driver with the numbers of the regulation."""
