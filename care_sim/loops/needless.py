"""Braking for nothing, told from the truth.

A keyframe with the brake on is needless if no body, reported or not, lies in the strip ahead that
the controller guards, nor would enter it within the controller's horizon if it kept its velocity.
The time for which the controller waits until it lets go does not count.

A brake for what a detector made up is unfounded: it is needless, and the first-sighting actor is
no reason for it while neither the camera has shown that actor nor a detection has held its returns.
"""

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.driver_settings import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.types import Tracks
from care_sim.driving.corridor import along_route, enters_strip
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

    def judge(self, world: World, sensor: Frame, braking: bool, unseen: int | None = None) -> bool:
        """Whether the brake is on for nothing; to be asked at every keyframe. The body `unseen`
        gives no reason to brake.
        """
        if not braking:
            return False
        if self._is_needed(world, sensor, unseen):
            self._needed_s = world.time
        return world.time - self._needed_s > self._rules.brake_release_s + LAST_BITS_S

    def _is_needed(self, world: World, sensor: Frame, unseen: int | None) -> bool:
        bodies = np.array([a.body for a in world.actors if a.body != unseen], np.int64)
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
        reach, horizon = self._reach_m, self._rules.brake_horizon_s
        return bool(enters_strip(ahead, self._front_m, reach, horizon).any())
