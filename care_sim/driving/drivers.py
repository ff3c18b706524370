"""The drivers by name."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Mask
from care_sim.core.cells.boxes import half_extents
from care_sim.core.conditions import BRAKING_RULES, CAREFUL_HUMAN, FIXED, DriverSettings
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.driving.corridor import in_strip
from care_sim.driving.human_model import HUMAN_MODEL

_STEADY_MPS = 0.1
"""Slower sideways motion is none: a box that is 1 cm off between two keyframes moves as fast."""


class CarefulHuman:
    """The competent and careful human driver of UN Regulation 157, who brakes on tracks.

    It acts on tracks, as the fixed controller does, so that a late detection delays it. A track
    ahead is in the way where its box overlaps the strip that the ego sweeps straight ahead, and it
    cuts in where it moves towards that strip and its middle is more than `wander_m` off the middle
    of the next lane. What has done either for `evaluation_s` is perceived as a risk. It is a danger
    once its time to collision along the road is at most `danger_s`.

    From the first danger on the driver brakes as `care_sim.driving.human_model` says, until no
    perceived risk is slower than the ego. Then it holds its speed as long as a risk is ahead, and
    without one gains speed at `comfort_mps2` up to its cruising speed: the regulation does not tell
    what comes after the braking.

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
        self.guarded_m = 2 * half_width_m
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
        return in_strip(tracks, self._front_m, self._half_width_m) | cuts_in

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
