"""Comfortable driving along a route: slow for bends, and follow who drives ahead.

It is what a driver does before anything calls for the brake, so it acts only while the brake is
off. Who drives ahead is the nearest track in the strip that the ego sweeps that moves along the
way. It is followed by the intelligent driver model (Treiber, Hennecke and Helbing 2000):
a (1 - (v / v_0)^4 - (s* / s)^2) with s* = s_0 + v T + v dv / (2 sqrt(a b)).
"""

from dataclasses import dataclass, replace

import numpy as np

from care_sim.core.cells.boxes import half_extents
from care_sim.core.types import Command, Tracks
from care_sim.driving.corridor import in_strip
from care_sim.world.route import SpeedPlan


@dataclass(frozen=True)
class CruisingRules:
    """The numbers of the driver and their sources."""

    comfort_mps2: float = 1.5
    """a: as the controller gains speed after braking."""
    slowing_mps2: float = 2.0
    """b, and the most by which it slows without the brake: comfortable, less than half of what the
    controller brakes with."""
    time_gap_s: float = 1.5
    """T of the model's authors for the city."""
    standstill_m: float = 2.0
    """s_0, as of the controller."""
    moving_mps: float = 0.5
    """What moves along the way faster than this drives ahead (tau_static of the paper)."""


class Cruising:
    """Drives by a plan. `front_m` and `half_width_m` are the ego's extents seen from its sensor."""

    def __init__(
        self,
        plan: SpeedPlan,
        front_m: float,
        half_width_m: float,
        keyframe_s: float,
        rules: CruisingRules = CruisingRules(),
    ):
        self._plan = plan
        self._front_m = front_m
        self._half_width_m = half_width_m
        self._keyframe_s = keyframe_s
        self._rules = rules

    def eased(self, command: Command, tracks: Tracks, speed: float, along_m: float) -> Command:
        """The controller's command, no faster than comfort has it. Tracks lie as they would before
        a car that drives straight ahead; the ego is `along_m` along its route.
        """
        if command.braking:
            return command
        comfort = min(self._for_the_way(speed, along_m), self._for_who_leads(tracks, speed))
        return replace(command, acceleration=min(command.acceleration, comfort))

    def _for_the_way(self, speed: float, along_m: float) -> float:
        # The speed that is planned for where the car will be when the command ends.
        planned = self._plan.at(along_m + speed * self._keyframe_s)
        wanted = (planned - speed) / self._keyframe_s
        return max(min(wanted, self._rules.comfort_mps2), -self._rules.slowing_mps2)

    def _for_who_leads(self, tracks: Tracks, speed: float) -> float:
        rules = self._rules
        half_x, _ = half_extents(tracks.boxes)
        gaps = tracks.boxes[:, 0] - half_x - self._front_m
        in_the_way = in_strip(tracks, self._front_m, self._half_width_m)
        leads = in_the_way & (gaps > 0) & (tracks.velocities[:, 0] > rules.moving_mps)
        if not leads.any():
            return np.inf
        lead = int(np.argmin(np.where(leads, gaps, np.inf)))
        closing = speed - tracks.velocities[lead, 0]
        wished = (
            rules.standstill_m
            + speed * rules.time_gap_s
            + speed * closing / (2 * np.sqrt(rules.comfort_mps2 * rules.slowing_mps2))
        )
        free = 1 - (speed / self._plan.cruise_mps) ** 4
        wanted = rules.comfort_mps2 * (free - (max(wished, 0.0) / gaps[lead]) ** 2)
        return float(max(wanted, -rules.slowing_mps2))
