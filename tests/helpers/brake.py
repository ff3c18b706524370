"""The fixed braking controller of one car."""

import numpy as np

from care_sim.core.types import Command, Tracks
from care_sim.driving.braking import BRAKE_OFF, braking_rules, decided


class Brake:
    """Decides keyframe by keyframe, as `care_sim.loops.stages.driving` does of many cars."""

    def __init__(self, cruise_mps, front_m, half_width_m, keyframe_s, settings):
        self._rules = braking_rules(front_m, half_width_m, keyframe_s, settings)
        self._own = float(cruise_mps), settings.brake_for_oncoming, self._rules
        self._brake = BRAKE_OFF

    def command(self, tracks, ego):
        """The command by tracks that lie before a car that drives straight ahead."""
        rows = tracks.rows()
        turns = np.cos(rows[:, Tracks.YAW]), np.sin(rows[:, Tracks.YAW])
        speed = float(ego.speed), float(ego.speed) ** 2
        self._brake, *command = decided(self._brake, rows, turns, speed, *self._own)
        return Command(*command)
