"""Who drives the car, and the numbers by which the fixed controller brakes."""

from dataclasses import dataclass, fields

from care_sim.base.bounds import bounded, one_of

FIXED, CAREFUL_HUMAN = DRIVERS = "fixed", "careful-human"


@dataclass(frozen=True, kw_only=True)
class DriverSettings:
    """The driver by name, and the rules of the fixed one with their sources.

    `careful-human` has the numbers of its regulation; of these it takes `comfort_mps2` alone.
    """

    driver: str = one_of(FIXED, DRIVERS)
    """Who brakes: `fixed`, the controller of `care_sim.driving.braking`, or `careful-human`, the
    driver model of UN Regulation 157 (`care_sim.driving.drivers`).
    """
    brake_mps2: float = bounded(5.0, 0.1, 20)
    """Deceleration b, m/s^2; 5 is the least that UN Regulation 152 asks of emergency braking."""
    brake_reaction_s: float = bounded(0.3, 0, 10)
    """From decision to full braking, seconds: build-up of brake pressure."""
    brake_standstill_m: float = bounded(2.0, 0, 50)
    """s_0, jam distance of the intelligent driver model (Treiber et al. 2000), metres, as in the
    guard of SBF.
    """
    brake_horizon_s: float = bounded(2.0, 0, 10)
    """How far ahead an entry is predicted, seconds: the two-second rule (Vogel 2003), as in the
    guard of SBF.
    """
    brake_side_margin_m: float = bounded(0.3, 0, 5)
    """Room kept on either side of the ego, metres."""
    brake_release_s: float = bounded(0.5, 0, 60)
    """The way must have been free this long before the brake is released, seconds."""
    brake_for_oncoming: bool = False
    """Whether a track that comes towards the ego counts where it will be, not where it is
    (`care_sim.driving.braking`). In the Euro NCAP tests it always does.
    """
    comfort_mps2: float = bounded(1.5, 0.01, 10)
    """Acceleration back to cruising speed, m/s^2."""


DRIVER_SETTINGS = tuple(field.name for field in fields(DriverSettings))
BRAKING_RULES = tuple(name for name in DRIVER_SETTINGS if name.startswith("brake_"))
"""Settings that the fixed controller alone knows."""
