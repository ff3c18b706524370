"""The guard of SBF at standstill, and the cells that forgetting releases with and without the
margin of Eq. 4. And what policies do while the camera is away.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Integers
from care_sim.core.belief import Observation
from care_sim.core.forgetting import (
    VEHICLE_SIGMA_M,
    Forgetting,
    ForgettingRules,
    released_cells,
)
from care_sim.core.grid import Cells
from care_sim.envs.sensing import SensingEnv
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.policies.base import Policy
from care_sim.study.appearances import is_covered
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


class Fallback:
    """Asks policies at every keyframe of a blackout, and after it until they differ, what they
    would fire on the belief of the policy that plays.

    A new entry is a body that a faultless camera shows for the first time. Truth is read for the
    scoring alone.
    """

    def __init__(self, env: SensingEnv[ClosedLoop], asked: Mapping[str, Policy]):
        self._env = env
        self._asked = asked
        self._shown: set[int] = set()
        self._dark = np.zeros(2, np.int64)
        """Keyframes in the dark, and those at which all fire alike."""
        self._entries_alike: list[int] = []
        self._entry_cells: list[int] = []
        self._entry_covered: list[int] = []
        self._apart_after_s: float | None = None

    def look(self, observation: Observation) -> None:
        """Note the coming keyframe, of which policies see the `observation`."""
        loop = self._env.loop
        faults = self._env.conditions
        if not faults.blackout_s:
            return
        entries = self._new_entries(loop)
        ended_s = faults.blackout_start_s + faults.blackout_s
        # A late picture of before the blackout still counts: the camera is away once none is left.
        dark = faults.black_at(loop.world.time) and not len(loop.belief.detections)
        lit_again = loop.world.time >= ended_s - LAST_BITS_S and self._apart_after_s is None
        if not (dark or lit_again):
            return
        fired = [self._env.would_fire(policy(observation)) for policy in self._asked.values()]
        alike = all(np.array_equal(cells, fired[0]) for cells in fired[1:])
        if dark:
            self._dark += [1, alike]
            self._note_entries(loop, entries, fired[0], alike)
        elif not alike:
            self._apart_after_s = max(0.0, loop.world.time - ended_s)

    def _new_entries(self, loop: ClosedLoop) -> Integers:
        """(n,) the bodies that a faultless camera shows for the first time."""
        shown = {body for body in loop.world.labels() if loop.shows(body)}
        entries = sorted(shown - self._shown)
        self._shown |= shown
        return np.array(entries, np.int64)

    def _note_entries(self, loop: ClosedLoop, entries: Integers, fired: Cells, alike: bool) -> None:
        """Note how many cells each of the new `entries` is given."""
        # A belief of no keyframe before: what is there at the start is no entry.
        if not loop.index:
            return
        boxes = loop.sensor.boxes_to_local(loop.world.boxes_of(entries))
        tracked = loop.rig.hulls(loop.belief.tracks.boxes).cells
        for hull in loop.rig.hulls(boxes):
            self._entries_alike.append(int(alike))
            self._entry_cells.append(int(np.isin(hull, fired).sum()))
            self._entry_covered.append(int(is_covered(hull, tracked)))

    def columns(self) -> Row:
        """As columns of a row."""
        dark, alike = self._dark.tolist()
        return {
            "dark_keyframes": dark,
            "dark_alike": alike,
            "dark_entries_alike": tuple(self._entries_alike),
            "dark_entry_cells": tuple(self._entry_cells),
            "dark_entry_covered": tuple(self._entry_covered),
            "apart_after_s": self._apart_after_s,
        }
