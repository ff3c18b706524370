"""The tracks of all worlds, as `care_sim.perception.tracker.TrackMemory` keeps those of one, and
the controllers that brake for them, as `care_sim.driving.braking` states them.
"""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.batch.scanning import Found
from care_sim.batch.state import (
    BatchState,
    Bodies,
    Reported,
    Sensors,
    TrackTables,
    placed_by,
    seen_by,
)
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.conditions import DriverSettings
from care_sim.core.rig import Rig
from care_sim.core.types import Tracks
from care_sim.driving.braking import BRAKE_OFF, Rules, braking_rules, decided
from care_sim.perception.tracker import (
    MemoryRules,
    assigned,
    forecast_in_place,
    lived_on,
    possible_pairs,
    seen_nearest_first,
)
from care_sim.perception.tracker import Rules as LifeRules
from care_sim.world.bodies import CATALOGUE

_BOX, _BOX_END = Tracks.BOX.start, Tracks.BOX.stop


class Tracking:
    """The track memories of all worlds. What `seen` returns it fills anew at the next call."""

    def __init__(self, keyframe_s: float, velocity_keyframes: int = 2):
        self._keyframe_s = float(keyframe_s)
        self._life = MemoryRules(velocity_keyframes=velocity_keyframes).life(keyframe_s)
        self._seen = np.empty((0, 0, len(Tracks.COLUMNS)))

    def update(self, state: BatchState, found: Found) -> None:
        """Assign what was found in this keyframe to the forecasts, start new tracks, drop old
        ones.
        """
        # As many rows as there will be if nothing that was found is known.
        needed = int((state.tracks.counts + found.counts).max(initial=0))
        if needed > state.tracks.rows.shape[1]:
            longer = np.zeros((state.worlds, 2 * needed, state.tracks.rows.shape[2]))
            longer[:, : state.tracks.rows.shape[1]] = state.tracks.rows
            state.tracks = state.tracks._replace(rows=longer)
        crowded = np.zeros(state.worlds, np.bool_)
        tables = state.bodies, state.reported, state.sensors, state.tracks
        _update(state.live, found, *tables, self._life, crowded)
        # Where a track could be two or two one, Python assigns, as in a single world.
        for world in np.flatnonzero(crowded).tolist():
            rows = found.rows[world, : found.counts[world]]
            classes, boxes = _detected(rows, state.bodies, state.reported, state.sensors, world)
            table = state.tracks.rows[world, : state.tracks.counts[world]]
            pairs = assigned(table, classes, boxes, self._life)
            _keep(state.tracks, world, classes, boxes, pairs, self._life)

    def predict(self, state: BatchState) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        _predict(state.live, state.tracks, self._keyframe_s)

    def seen(self, state: BatchState) -> tuple[Integers, Floats]:
        """Tracks in the frame of each sensor, the nearest first: how many (W,), and the rows
        (W, T, 13).
        """
        if self._seen.shape != state.tracks.rows.shape:
            self._seen = np.empty(state.tracks.rows.shape)
        _see(state.live, state.tracks, state.sensors, self._seen)
        return state.tracks.counts, self._seen


@compiled(brief=True)
def _update(
    live: Mask,
    found: Found,
    bodies: Bodies,
    reported: Reported,
    sensors: Sensors,
    tracks: TrackTables,
    life: LifeRules,
    crowded: Mask,
) -> None:
    """See `Tracking.update`; worlds that are `crowded` (W,) it tells, and leaves alone."""
    for w in range(len(live)):
        if live[w]:
            rows = found.rows[w, : found.counts[w]]
            classes, boxes = _detected(rows, bodies, reported, sensors, w)
            table = tracks.rows[w, : tracks.counts[w]]
            _, _, pairs, alone = possible_pairs(table, classes, boxes, life)
            if alone:
                _keep(tracks, w, classes, boxes, pairs, life)
            else:
                crowded[w] = True


@compiled(brief=True)
def _detected(
    rows: Integers, bodies: Bodies, reported: Reported, sensors: Sensors, w: int
) -> tuple[Integers, Floats]:
    """Classes (n,) and boxes (n, 7) in the world, of the reported bodies in these `rows` (n,) of a
    world.
    """
    classes = np.empty(len(rows), np.int64)
    boxes = np.empty((len(rows), 7))
    for n in range(len(rows)):
        classes[n] = reported.classes[w, rows[n]]
        boxes[n] = bodies.boxes[w, reported.bodies[w, rows[n]]]

    # A detector tells boxes in the frame of the sensor: on the way there and back they are rounded.
    return classes, placed_by(sensors, w, seen_by(sensors, w, boxes))


@compiled(brief=True)
def _keep(
    tracks: TrackTables,
    w: int,
    classes: Integers,
    boxes: Floats,
    pairs: tuple[Integers, Integers],
    life: LifeRules,
) -> None:
    """Let the tracks of a world live on."""
    table = tracks.rows[w, : tracks.counts[w]]
    kept, ids = lived_on(table, classes, boxes, pairs, life, tracks.next_ids[w])
    tracks.rows[w, : len(kept)] = kept
    tracks.counts[w] = len(kept)
    for number in ids:
        tracks.next_ids[w] = max(tracks.next_ids[w], number + 1)


@compiled(brief=True)
def _predict(live: Mask, tracks: TrackTables, seconds: float) -> None:
    """See `Tracking.predict`."""
    for w in range(len(live)):
        if live[w]:
            forecast_in_place(tracks.rows[w, : tracks.counts[w]], seconds)


@compiled(brief=True)
def _see(live: Mask, tracks: TrackTables, sensors: Sensors, seen: Floats) -> None:
    """See `Tracking.seen`."""
    for w in range(len(live)):
        if live[w]:
            table = tracks.rows[w, : tracks.counts[w]]
            turn = sensors.turns_back[w, 0], sensors.turns_back[w, 1]
            boxes = seen_by(sensors, w, table[:, _BOX:_BOX_END])
            seen[w, : len(table)] = seen_nearest_first(table, boxes, turn)


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
