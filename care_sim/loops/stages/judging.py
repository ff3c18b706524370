"""Judgements for the scoring, world by world: needless and unfounded brakes, and sights of the
actors that the ego meets. Truth.
"""

from collections.abc import Callable, Mapping

import numpy as np

from care_sim.core.arrays import Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.driving.corridor import enters_strip
from care_sim.loops.needless import NeedlessBraking, UnfoundedBraking, in_the_way
from care_sim.loops.records import Sight
from care_sim.loops.stages.detecting import Detecting
from care_sim.loops.stages.driving import Ahead, Driving
from care_sim.loops.stages.state import State, seen_by
from care_sim.perception.found import Found
from care_sim.world.world import World


class Judging:
    """The judges of `worlds` worlds, whose drivers guard a strip."""

    def __init__(self, rig: Rig, rules: DriverSettings, driving: Driving, worlds: int):
        self._rig = rig
        self._rules = rules
        self._strip = driving.front_m, driving.guarded_m / 2, rules.brake_horizon_s
        self._needless: dict[int, NeedlessBraking] = {}
        self._unfounded: dict[int, UnfoundedBraking] = {}
        self._meeting: dict[int, Integers] = {}

    def begin(self, world: int, built: World, is_proxy: bool) -> None:
        """Begin an episode."""
        for judges in (self._needless, self._unfounded, self._meeting):
            judges.pop(world, None)
        # Only the outcome of a drive holds it, and it reads the truth about every body.
        if built.speed_plan:
            self._needless[world] = NeedlessBraking(self._rules.brake_release_s)
        # The proxy reports bodies alone. Another detector may make one up.
        if not is_proxy:
            self._unfounded[world] = UnfoundedBraking(self._rules.brake_release_s)
        if built.meetings:
            self._meeting[world] = np.array([one.body for one in built.meetings], np.int64)

    @property
    def worlds(self) -> set[int]:
        """The worlds whose brakes are judged."""
        return {*self._needless, *self._unfounded}

    def judge(
        self,
        built: Mapping[int, World],
        ahead: Mapping[int, Ahead],
        found: Found,
        braking: Mask,
        in_view: Mask,
    ) -> tuple[Mask, Mask]:
        """(W,) which brakes are needless and which are unfounded, of the worlds that are
        `built`; see `care_sim.loops.needless`.
        """
        needless, unfounded = np.zeros((2, len(braking)), np.bool_)
        x, _, z = self._rig.sensor_position
        for world, there in built.items():
            (own, lying), brakes = ahead[world], bool(braking[world])
            bodies, entering = np.empty(0, np.int64), np.empty((0, 7))
            if brakes:
                middle = Frame.mounted(there.ego.pose, (x, 0.0, z))
                bodies = in_the_way(there, middle, *self._strip)
                entering = middle.boxes_to_world(own.boxes[enters_strip(lying, *self._strip)])
            if world in self._needless:
                needed = len(bodies) > 0
                needless[world] = self._needless[world].judge(there.time, brakes, needed)
            if world in self._unfounded:
                seen = bool(in_view[world]), found.behind(world)
                unfounded[world] = self._unfounded[world].judge_tracks(
                    there, entering, bodies, brakes, *seen
                )
        return needless, unfounded

    def sights(
        self, state: State, shows: Callable[[int, int], bool], detecting: Detecting, found: Found
    ) -> dict[int, tuple[Sight, ...]]:
        """Return the sights of the actors that egos are to meet, at this scan, in live worlds with
        some. `shows` says of a world and a body whether a camera shows it.
        """
        sights = {}
        for world in (n for n in self._meeting if state.live[n]):
            bodies = self._meeting[world]
            boxes = seen_by(state.sensors, world, state.bodies.boxes[world, bodies])
            detected = detecting.bodies_found(found, world)
            sights[world] = tuple(
                Sight(distance, shows(world, body), body in detected)
                for body, distance in zip(
                    bodies.tolist(), planar_ranges(boxes).tolist(), strict=True
                )
            )
        return sights
