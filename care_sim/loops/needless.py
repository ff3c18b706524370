"""Needless braking, judged by the truth.

The controller guards a strip ahead. A keyframe with the brake on is needless if no body, reported
or not, is in this strip or would enter it within the controller's horizon at constant velocity. The
time for which the controller waits until it lets go does not count.

A brake for what a detector made up is unfounded: it is needless, and no track in the strip touches
a body, reported or not. A detector that misjudges the speed or size of a real body has invented
nothing. The first-sighting actor is no such body, and no reason to brake, while neither the camera
has shown that actor nor a detection has held its returns.
"""

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Tracks
from care_sim.driving.corridor import along_route, enters_strip
from care_sim.world.bullet import NO_BODY
from care_sim.world.contact import least_gap
from care_sim.world.world import World


def in_the_way(
    world: World, sensor: Frame, front_m: float, reach_m: float, horizon_s: float
) -> Integers:
    """Return (n,) the bodies that are in a strip ahead, as `enters_strip` says. Truth."""
    bodies = np.array([actor.body for actor in world.actors], np.int64)
    rows = np.zeros((len(bodies), len(Tracks.COLUMNS)))
    rows[:, Tracks.BOX] = sensor.boxes_to_local(world.boxes_of(bodies))
    rows[:, Tracks.VELOCITY] = turned(world.velocities_of(bodies), -sensor.yaw)
    true = Tracks.from_checked_rows(rows)
    ahead = true if world.route is None else along_route(true, world.route, sensor)
    return np.asarray(bodies[enters_strip(ahead, front_m, reach_m, horizon_s)])


class NeedlessBraking:
    """Judges the brake of one episode, which a driver lets go `release_s` after the last need."""

    def __init__(self, release_s: float):
        self._release_s = release_s
        self._needed_s = -np.inf

    def judge(self, time: float, braking: bool, needed: bool) -> bool:
        """Return whether the brake is on for nothing; call this at every keyframe."""
        if not braking:
            return False
        if needed:
            self._needed_s = time
        return time - self._needed_s > self._release_s + LAST_BITS_S


class UnfoundedBraking(NeedlessBraking):
    """Judges whether the brake of one episode is on for what the detector made up."""

    _has_met = False
    """Whether the camera has shown the first-sighting actor, or a detection held its returns."""

    def judge_tracks(
        self,
        world: World,
        entering: Floats,
        bodies: Integers,
        braking: bool,
        in_view: bool,
        behind: Integers,
    ) -> bool:
        """Return whether the braking is unfounded; call this at every keyframe. `entering` (n, 7)
        are the world boxes of tracks in the way, and `bodies` (m,) are those `in_the_way`. `behind`
        (k,) are the bodies behind the detections. `in_view` says whether a camera shows the
        first-sighting actor.
        """
        target = world.first_sighting
        if not self._has_met:
            self._has_met = in_view or (target is not None and target.body in behind)
        unseen = NO_BODY if self._has_met or target is None else target.body
        needed = braking and bool((bodies != unseen).any() or _touch(entering, world, unseen))
        return self.judge(world.time, braking, needed)


def _touch(boxes: Floats, world: World, unseen: int) -> bool:
    """Whether one of `boxes` (n, 7) may touch an actor other than `unseen`, seen from above."""
    others = world.boxes([actor for actor in world.actors if actor.body != unseen])
    return any(least_gap(box, other) <= 0 for box in boxes for other in others)
