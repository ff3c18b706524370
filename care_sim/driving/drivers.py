"""The drivers by name, and how they drive along a route before anything calls for the brake."""

from dataclasses import dataclass, replace

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Mask
from care_sim.core.cells.boxes import half_extents
from care_sim.core.conditions import BRAKING_RULES, FIXED, DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.corridor import enters_strip
from care_sim.world.route import SpeedPlan

_STANDARD_GRAVITY = 9.80665
"""m/s^2, by definition (ISO 80000-3)."""


@dataclass(frozen=True)
class HumanModel:
    """The competent and careful human driver of UN Regulation 157: its numbers, and how it brakes.
    Metres, seconds.

    The source is Annex 3 of the 01 series of amendments, its Table 1 and the section on cutting in.
    In the original text of 2021 it is Annex 4, Appendix 3. The driver perceives a vehicle that
    leaves the middle of its lane, evaluates the risk, and after a delay brakes harder and harder up
    to a limit. The table's last line, 0.85 g after both vehicles overlap fully, is left out. It
    describes an emergency braking system (UN Regulation 152), and no driver. The Joint Research
    Centre's program of the model also leaves it out (github.com/ec-jrc/JRC-FSM).
    """

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


_STEADY_MPS = 0.1
"""Slower sideways motion is none: a box that is 1 cm off between two keyframes moves as fast."""


class CarefulHuman:
    """The competent and careful human driver of UN Regulation 157, who brakes on tracks.

    It acts on tracks, as the fixed controller does, so that a late detection delays it. A track
    ahead is in the way where its box overlaps the strip that the ego sweeps straight ahead. It cuts
    in where it moves towards that strip and its middle is more than `wander_m` off the middle of
    the next lane. A track that has done either for `evaluation_s` is perceived as a risk. A risk is
    a danger once its time to collision along the road is at most `danger_s`.

    From the first danger on the driver brakes as `HumanModel` says, until no perceived risk is
    slower than the ego. Then it holds its speed while a risk is ahead. Otherwise it accelerates at
    `comfort_mps2` to its cruising speed. The regulation does not define the time after braking.

    `front_m` and `half_width_m` are the ego's extents seen from its sensor, metres; it cruises at
    `cruise_mps`.
    """

    def __init__(
        self,
        cruise_mps: float,
        front_m: float,
        half_width_m: float,
        keyframe_s: float,
        settings: DriverSettings,
    ):
        self._cruise_mps = cruise_mps
        self._front_m = front_m
        self._half_width_m = half_width_m
        self._keyframe_s = keyframe_s
        self._comfort_mps2 = settings.comfort_mps2
        self._evaluated_s: dict[int, float] = {}
        self._danger_s: float | None = None

    def command(self, tracks: Tracks, ego: Ego) -> Command:
        """Decide from the tracks of this keyframe, as they lie before a car that drives straight
        ahead, and the ego's motion.
        """
        half_x, _ = half_extents(tracks.boxes)
        risks = self._perceived(tracks, self._risky(tracks))
        closing = ego.speed - tracks.velocities[:, 0]
        if self._danger_s is None:
            gaps = tracks.boxes[:, 0] - half_x - self._front_m
            if np.any(risks & (closing > 0) & (gaps <= closing * HUMAN_MODEL.danger_s)):
                self._danger_s = 0.0
        else:
            self._danger_s += self._keyframe_s
            if not np.any(risks & (closing > 0)):
                self._danger_s = None
        return self._act(ego.speed, held=bool(np.any(risks)))

    def _act(self, speed: float, held: bool) -> Command:
        if self._danger_s is None:
            comfort = 0.0 if held else self._comfort_mps2
            wanted = (self._cruise_mps - speed) / self._keyframe_s
            return Command(float(min(max(wanted, -comfort), comfort)), False)
        # The mean over the keyframe, for which the car holds it.
        ends = np.array([self._danger_s, self._danger_s + self._keyframe_s])
        before, after = HUMAN_MODEL.speed_lost(ends)
        return Command(float((before - after) / self._keyframe_s), True)

    def _risky(self, tracks: Tracks) -> Mask:
        """(n,) which tracks are in the way or cut in."""
        half_x, _ = half_extents(tracks.boxes)
        ahead = tracks.boxes[:, 0] + half_x > self._front_m
        towards_mps = -np.sign(tracks.boxes[:, 1]) * tracks.velocities[:, 1]
        off_its_lane = np.abs(tracks.boxes[:, 1]) < HUMAN_MODEL.lane_m - HUMAN_MODEL.wander_m
        cuts_in = ahead & off_its_lane & (towards_mps > _STEADY_MPS)
        return enters_strip(tracks, self._front_m, self._half_width_m) | cuts_in

    def _perceived(self, tracks: Tracks, risky: Mask) -> Mask:
        """(n,) which tracks have been risky for as long as their evaluation takes."""
        # The first keyframe begins the evaluation; a track that is risky no more begins anew.
        known = self._evaluated_s
        self._evaluated_s = {
            track: known.get(track, -self._keyframe_s) + self._keyframe_s
            for track in tracks.ids[risky].tolist()
        }
        least_s = HUMAN_MODEL.evaluation_s - LAST_BITS_S
        evaluated = [self._evaluated_s.get(track, -1.0) for track in tracks.ids.tolist()]
        return np.array(evaluated, dtype=float) >= least_s


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
    """Speed along the way above which a track drives ahead (tau_static of the paper)."""


class Cruising:
    """Comfortable driving along a route by a plan: slow for bends, and follow who drives ahead.

    It is what a driver does before anything calls for the brake, so it acts only while the brake is
    off. The vehicle ahead is the nearest track in the ego's swept strip that moves along the way.
    It is followed by the intelligent driver model (Treiber, Hennecke and Helbing 2000):
    a (1 - (v / v_0)^4 - (s* / s)^2) with s* = s_0 + v T + v dv / (2 sqrt(a b)).

    `front_m` and `half_width_m` are the ego's extents seen from its sensor.
    """

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
        in_the_way = enters_strip(tracks, self._front_m, self._half_width_m)
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
