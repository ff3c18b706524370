"""How fast a car means to go along its route when nothing is in its way."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.world.route import Route

_SPACING_M = 0.25
"""Between two places at which the plan is worked out; a bend begins within it."""
_AS_PLANNED_MPS = 0.3
"""A car that lacks no more than this goes as planned: twice what it gains in 0.1 s. One that brakes
hard lacks more after one keyframe."""


@dataclass(frozen=True)
class SpeedPlan:
    """At most `cruise_mps`, and through a bend at most what keeps the sideways acceleration at
    `sideways_mps2`. Before a bend the car slows at `comfort_mps2`, after it gains speed alike.
    """

    route: Route
    cruise_mps: float
    sideways_mps2: float
    comfort_mps2: float

    def at(self, s: float) -> float:
        """m/s that the car means to have at `s` metres along the route."""
        return float(np.interp(s, self._places, self._speeds))

    def seconds_to(self, here: float, there: float, speed: float, gaining: float) -> float:
        """Seconds from `here` to `there` for a car that has `speed` m/s now and goes on gaining
        speed by `gaining` m/s^2, 0 or more, where the plan allows it; one that goes as planned goes
        on as planned. 0 where it is past, inf for a car that stands and stays.
        """
        if there <= here:
            return 0.0
        # In a bend a car that goes as planned gains nothing, but will after it.
        if speed > self.at(here) - _AS_PLANNED_MPS:
            gaining = self.comfort_mps2
        places = np.linspace(here, there, max(int(np.ceil((there - here) / _SPACING_M)), 1) + 1)
        planned = np.interp(places, self._places, self._speeds)
        gained = np.sqrt(speed**2 + 2 * gaining * (places - here))
        return float(np.sum(_seconds_between(places, np.minimum(planned, gained))))

    def times(self, places: Floats) -> Floats:
        """(n,) seconds from the first of `places` (n,), ascending, to each, driven as planned."""
        speeds = np.interp(places, self._places, self._speeds)
        return np.concatenate([[0.0], np.cumsum(_seconds_between(places, speeds))])

    @cached_property
    def _places(self) -> Floats:
        return np.arange(0.0, self.route.length + _SPACING_M, _SPACING_M)

    @cached_property
    def _speeds(self) -> Floats:
        bends = np.array([abs(self.route.curvature(s)) for s in self._places.tolist()])
        with np.errstate(divide="ignore"):
            speeds = np.minimum(self.cruise_mps, np.sqrt(self.sideways_mps2 / bends))
        # v^2 grows by 2 a per metre: from each place on, and back from each.
        for here in range(1, len(speeds)):
            speeds[here] = min(speeds[here], self._reached(speeds[here - 1]))
        for here in range(len(speeds) - 2, -1, -1):
            speeds[here] = min(speeds[here], self._reached(speeds[here + 1]))
        return speeds

    def _reached(self, speed: float) -> float:
        return float(np.sqrt(speed**2 + 2 * self.comfort_mps2 * _SPACING_M))


def _seconds_between(places: Floats, speeds: Floats) -> Floats:
    """(n - 1,) seconds from each of `places` (n,) to the next for a car that has `speeds` there."""
    # Even acceleration from place to place: the mean of two speeds is that of the way between.
    means = (speeds[1:] + speeds[:-1]) / 2
    with np.errstate(divide="ignore"):
        return np.asarray(np.diff(places) / means)
