"""The drivers of all worlds.

The fixed controller (`care_sim.driving.braking`) decides in compiled code. Other drivers, and
driving along a route, run world by world.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import FIXED, DriverSettings
from care_sim.core.rig import Rig
from care_sim.core.types import Command, Ego, Tracks
from care_sim.driving.braking import BRAKE_OFF, Rules, braking_rules, decided, guarded_m
from care_sim.driving.corridor import along_route
from care_sim.driving.drivers import CarefulHuman, Cruising, CruisingRules
from care_sim.loops.stages.state import State
from care_sim.world.bodies import CATALOGUE
from care_sim.world.world import World

_YAW = Tracks.YAW


class Drivers(NamedTuple):
    """Columns (W,) of the worlds: the brake, `since_s` and `free_s`, as in
    `care_sim.driving.braking.Brake`; the speed at which it cruises, and whether it brakes
    for who comes towards it.
    """

    since_s: Floats
    free_s: Floats
    cruise_mps: Floats
    for_oncoming: Mask


class Ahead(NamedTuple):
    """The tracks of a world in the frame from which its driver measures, and as they lie ahead
    along its way.
    """

    tracks: Tracks
    ahead: Tracks


class Driving:
    """The drivers of `worlds` worlds, all of one car. The arrays that `command` returns are
    reused at the next call.
    """

    front_m: float
    """How far the car reaches ahead of its sensor."""
    guarded_m: float
    """Width of the strip ahead that a driver guards, metres."""

    def __init__(self, rig: Rig, settings: DriverSettings, worlds: int):
        length, width, _ = CATALOGUE["ego"].size
        # The front bumper is farther from a sensor behind the middle than half a length.
        self.front_m = length / 2 - rig.sensor_x_m
        self._half_width_m = width / 2
        self._keyframe_s = rig.keyframe_s
        self._settings = settings
        is_fixed = settings.driver == FIXED
        self.guarded_m = guarded_m(width / 2, settings) if is_fixed else width
        self._rules = braking_rules(self.front_m, width / 2, rig.keyframe_s, settings)
        self._drivers = Drivers(
            np.zeros(worlds), np.zeros(worlds), np.zeros(worlds), np.zeros(worlds, np.bool_)
        )
        self._commands = np.zeros(worlds), np.zeros(worlds, np.bool_)
        self._built: dict[int, World] = {}
        self._special: set[int] = set()
        self._humans: dict[int, CarefulHuman] = {}
        self._cruising: dict[int, Cruising | None] = {}

    def begin(self, world: int, built: World) -> None:
        """Begin the episode of a world."""
        drivers, settings, cruise_mps = self._drivers, self._settings, built.ego_motion.speed
        drivers.since_s[world], drivers.free_s[world] = BRAKE_OFF
        drivers.cruise_mps[world] = cruise_mps
        # The scenario knows whether somebody may come towards the ego into its way.
        drivers.for_oncoming[world] = settings.brake_for_oncoming or built.has_oncoming
        self._built[world] = built
        extents = self.front_m, self._half_width_m, self._keyframe_s
        if settings.driver != FIXED:
            self._humans[world] = CarefulHuman(cruise_mps, *extents, settings)
        comfort = CruisingRules(comfort_mps2=settings.comfort_mps2)
        plan = built.speed_plan
        self._cruising[world] = Cruising(plan, *extents, comfort) if plan else None
        self._special.discard(world)
        if settings.driver != FIXED or built.route or plan:
            self._special.add(world)

    def ahead(
        self, state: State, tracks: tuple[Integers, Floats], also: Collection[int]
    ) -> dict[int, Ahead]:
        """Return tracks in the frames of `state.driven`, per live world with another driver, a
        route or a plan, and per live world in `also`. `tracks` are the numbers of rows (W,) and the
        rows (W, T, 13).
        """
        counts, rows = tracks
        found = {}
        for world in sorted(self._special.union(also)):
            if not state.live[world]:
                continue
            built = self._built[world]
            own = lying = Tracks.from_checked_rows(rows[world, : counts[world]].copy())
            if built.route is not None:
                lying = along_route(own, built.route, state.driven.frame(world))
            found[world] = Ahead(own, lying)
        return found

    def command(
        self, state: State, tracks: tuple[Integers, Floats], ahead: Mapping[int, Ahead]
    ) -> tuple[Floats, Mask]:
        """Accelerations (W,) that the drivers choose, and (W,) whether each brakes, by the `tracks`
        that lie `ahead`.
        """
        counts, rows = tracks
        for world, (_, lying) in ahead.items():
            rows[world, : len(lying)] = lying.rows()
        if self._settings.driver == FIXED:
            # NumPy's sines and cosines, and Python's squares.
            headings = _headings(state.live, counts, rows)
            turns = np.cos(headings), np.sin(headings)
            speeds = state.read[:, 0].copy()
            squares = np.array([speed**2 for speed in speeds.tolist()])
            given = counts, rows, turns, speeds, squares
            _command(state.live, given, self._drivers, self._rules, self._commands)
        for world, (_, lying) in ahead.items():
            ego = Ego(*state.read[world].tolist())
            self._commands[0][world], self._commands[1][world] = self._own(world, lying, ego)
        return self._commands

    def _own(self, world: int, ahead: Tracks, ego: Ego) -> tuple[float, bool]:
        """The command in a world, of its own driver and by its plan."""
        human, cruising = self._humans.get(world), self._cruising[world]
        accelerations, braking = self._commands
        command = Command(float(accelerations[world]), bool(braking[world]))
        if human is not None:
            command = human.command(ahead, ego)
        if cruising is not None:
            command = cruising.eased(command, ahead, ego.speed, self._built[world].along_m)
        return command.acceleration, command.braking


@compiled(brief=True)
def _headings(live: Mask, counts: Integers, tracks: Floats) -> Floats:
    """The headings of all tracks, world after world."""
    count = 0
    for w in range(len(live)):
        count += counts[w] if live[w] else 0
    headings = np.empty(count)
    count = 0
    for w in range(len(live)):
        for n in range(counts[w] if live[w] else 0):
            headings[count] = tracks[w, n, _YAW]
            count += 1
    return headings


@compiled(brief=True)
def _command(
    live: Mask,
    given: tuple[Integers, Floats, tuple[Floats, Floats], Floats, Floats],
    drivers: Drivers,
    rules: Rules,
    commands: tuple[Floats, Mask],
) -> None:
    """See `Driving.command`."""
    counts, tracks, turns, speeds, squares = given
    accelerations, braking = commands
    begin = 0
    for w in range(len(live)):
        if live[w]:
            end = begin + counts[w]
            brake, accelerations[w], braking[w] = decided(
                (drivers.since_s[w], drivers.free_s[w]),
                tracks[w, : counts[w]],
                (turns[0][begin:end], turns[1][begin:end]),
                (speeds[w], squares[w]),
                drivers.cruise_mps[w],
                drivers.for_oncoming[w],
                rules,
            )
            drivers.since_s[w], drivers.free_s[w] = brake
            begin = end
