"""The drivers by name."""

from collections.abc import Callable
from typing import Protocol

from care_sim.base.errors import InvalidInput
from care_sim.core.driver_settings import BRAKING_RULES, CAREFUL_HUMAN, FIXED, DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.driving.careful_human import CarefulHuman
from care_sim.driving.human_model import HUMAN_MODEL


class Driver(Protocol):
    """Drives the car along its lane."""

    guarded_m: float
    """Width of the strip ahead that it guards, metres."""

    def command(self, tracks: Tracks, ego: Ego) -> Command:
        """Decide from the tracks of this keyframe, as they lie before a car that drives straight
        ahead, and the ego's motion.
        """
        ...


_KINDS: dict[str, Callable[..., Driver]] = {
    FIXED: BrakingController,
    CAREFUL_HUMAN: CarefulHuman,
}


def check_driver(settings: DriverSettings) -> None:
    """Raise InvalidInput for rules that the driver does not know."""
    usual = DriverSettings()
    for name in BRAKING_RULES if settings.driver != FIXED else ():
        if getattr(settings, name) != getattr(usual, name):
            raise InvalidInput(
                f"{name} is of the driver {FIXED}, {settings.driver} does not know it"
            )


def brake_delay_s(settings: DriverSettings) -> float:
    """Seconds from the driver's decision until the brake acts."""
    return settings.brake_reaction_s if settings.driver == FIXED else HUMAN_MODEL.delay_s


def make_driver(
    settings: DriverSettings,
    cruise_mps: float,
    front_m: float,
    half_width_m: float,
    keyframe_s: float,
) -> Driver:
    """The driver of an episode. `front_m` and `half_width_m` are the ego's extents seen from its
    sensor, metres; it cruises at `cruise_mps`.
    """
    return _KINDS[settings.driver](cruise_mps, front_m, half_width_m, keyframe_s, settings)
