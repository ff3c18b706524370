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
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.types import Tracks
from care_sim.driving.corridor import along_route, enters_strip
from care_sim.world.contact import least_gap
from care_sim.world.world import World


class NeedlessBraking:
    """Judges the brake of one episode. `front_m` is how far the ego reaches ahead of its sensor,
    `reach_m` half of the strip that its driver guards, metres.
    """

    def __init__(self, front_m: float, reach_m: float, rules: DriverSettings):
        self._front_m = front_m
        self._reach_m = reach_m
        self._rules = rules
        self._needed_s = -np.inf

    def judge(self, world: World, sensor: Frame, braking: bool) -> bool:
        """Whether the brake is on for nothing; to be asked at every keyframe."""
        return self._judged(world, braking, braking and self._is_needed(world, sensor))

    def _judged(self, world: World, braking: bool, needed: bool) -> bool:
        if not braking:
            return False
        if needed:
            self._needed_s = world.time
        return world.time - self._needed_s > self._rules.brake_release_s + LAST_BITS_S

    def _is_needed(self, world: World, sensor: Frame, unseen: int | None = None) -> bool:
        bodies = _bodies(world, unseen)
        count = np.zeros(len(bodies), np.int64)
        true = Tracks(
            bodies,
            count,
            sensor.boxes_to_local(world.boxes_of(bodies)),
            sensor.vectors_to_local(
                np.column_stack([world.velocities_of(bodies), np.zeros(len(bodies))])
            )[:, :2],
            count,
            count,
        )
        ahead = true if world.route is None else along_route(true, world.route, sensor)
        return bool(self._enters(ahead).any())

    def _enters(self, ahead: Tracks) -> Mask:
        return enters_strip(ahead, self._front_m, self._reach_m, self._rules.brake_horizon_s)


class UnfoundedBraking(NeedlessBraking):
    """Judges whether the brake of one episode is on for what the detector made up."""

    _has_met = False
    """Whether the camera has shown the first-sighting actor, or a detection held its returns."""

    def judge_tracks(
        self,
        world: World,
        sensor: Frame,
        tracks: Tracks,
        ahead: Tracks,
        braking: bool,
        in_view: bool,
        behind: Integers,
    ) -> bool:
        """Return whether the braking is needless; call this at every keyframe. `tracks` are in the
        sensor frame, and `ahead` are the same tracks as the driver takes them. `behind` (n,) are
        the bodies behind the detections. `in_view` says whether a camera shows the first-sighting
        actor.
        """
        target = world.first_sighting
        self._has_met |= in_view or (target is not None and target.body in behind)
        if not braking:
            return False
        unseen = None if self._has_met or target is None else target.body
        needed = self._is_needed(world, sensor, unseen) or _touch(
            sensor.boxes_to_world(tracks.boxes[self._enters(ahead)]),
            world.boxes_of(_bodies(world, unseen)),
        )
        return self._judged(world, True, needed)


def _bodies(world: World, unseen: int | None) -> Integers:
    return np.array([actor.body for actor in world.actors if actor.body != unseen], np.int64)


def _touch(boxes: Floats, others: Floats) -> bool:
    """Whether one of `boxes` (n, 7) may touch one of `others` (m, 7), seen from above."""
    return any(least_gap(box, other) <= 0 for box in boxes for other in others)
