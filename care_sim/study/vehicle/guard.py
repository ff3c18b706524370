"""The guard of SBF at standstill, and the cells that forgetting releases with and without the
margin of Eq. 4.
"""

from dataclasses import replace

import numpy as np

from care_sim.core.forgetting import (
    VEHICLE_SIGMA_M,
    Forgetting,
    ForgettingRules,
    released_cells,
)
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.study.run_config import Row


class Guard:
    """Runs Algorithm 3 beside the policy that plays, once as in simulation (sigma_pos 0) and once
    as on the paper's vehicle (0.4 m).
    """

    def __init__(self, loop: ClosedLoop):
        self._rules = ForgettingRules()
        vehicle = replace(self._rules, position_sigma_m=VEHICLE_SIGMA_M)
        self._forgetting = [Forgetting(rules, loop.rig) for rules in (self._rules, vehicle)]
        self._standing_guards_m: list[float] = []
        self._released = np.zeros(2, np.int64)

    def look(self, loop: ClosedLoop) -> None:
        """Note the coming keyframe."""
        belief = loop.belief
        # Whether the car stands is the truth; what the guard is told is what odometry reads.
        if loop.world.ego_motion.speed == 0:
            self._standing_guards_m.append(self._rules.guard_distance(belief.ego.speed))
        hulls = loop.rig.hulls(belief.tracks.boxes)
        for forgetting in self._forgetting:
            forgetting.advance(belief.tracks, belief.ego)
        kept = [forgetting.exploitation(belief.tracks) for forgetting in self._forgetting]
        self._released += [released_cells(hulls, sets, loop.rig.grid.size) for sets in kept]

    def columns(self) -> Row:
        """As columns of a row."""
        guards = self._standing_guards_m
        released, with_margin = self._released.tolist()
        return {
            "standing_keyframes": len(guards),
            "standing_guard_least_m": min(guards, default=None),
            "standing_guard_most_m": max(guards, default=None),
            "released_cells": released,
            "released_cells_vehicle": with_margin,
        }
