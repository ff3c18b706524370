"""The fixed braking controllers of all worlds, as `care_sim.driving.braking` states them."""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import DriverSettings
from care_sim.core.rig import Rig
from care_sim.core.types import Tracks
from care_sim.driving.braking import BRAKE_OFF, Rules, braking_rules, decided
from care_sim.world.bodies import CATALOGUE

_YAW = Tracks.YAW


class Drivers(NamedTuple):
    """Of each world, (W,): its brake, `since_s` and `free_s`, as in
    `care_sim.driving.braking.Brake`; the speed at which it cruises, and whether it brakes
    for who comes towards it.
    """

    since_s: Floats
    free_s: Floats
    cruise_mps: Floats
    for_oncoming: Mask


class Braking:
    """The controllers of `worlds` worlds, all of one car. What `command` returns it fills anew at
    the next call.
    """

    def __init__(self, rig: Rig, settings: DriverSettings, worlds: int):
        length, width, _ = CATALOGUE["ego"].size
        front_m = length / 2 - rig.sensor_x_m
        self._rules = braking_rules(front_m, width / 2, rig.keyframe_s, settings)
        self._settings = settings
        self._drivers = Drivers(
            np.zeros(worlds), np.zeros(worlds), np.zeros(worlds), np.zeros(worlds, np.bool_)
        )
        self._accelerations = np.zeros(worlds)
        self._braking = np.zeros(worlds, np.bool_)

    def begin(self, world: int, cruise_mps: float, for_oncoming: bool) -> None:
        """Begin the episode of a world, in which somebody may come towards the ego into its way or
        not.
        """
        drivers = self._drivers
        drivers.since_s[world], drivers.free_s[world] = BRAKE_OFF
        drivers.cruise_mps[world] = cruise_mps
        drivers.for_oncoming[world] = self._settings.brake_for_oncoming or for_oncoming

    def command(
        self, live: Mask, counts: Integers, tracks: Floats, speeds: Floats
    ) -> tuple[Floats, Mask]:
        """Accelerations (W,) that the cars ask for, and (W,) whether each brakes.

        `tracks` (W, T, 13) are as they lie before each car, `counts` (W,) of them, and `speeds`
        (W,) the cars' own.
        """
        # NumPy's sines and cosines, and Python's squares, as for a single car.
        headings = _headings(live, counts, tracks)
        turns = np.cos(headings), np.sin(headings)
        squares = np.array([speed**2 for speed in speeds.tolist()])
        given = counts, tracks, turns, speeds, squares
        commands = self._accelerations, self._braking
        _command(live, given, self._drivers, self._rules, commands)
        return commands


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
    """See `Braking.command`."""
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
