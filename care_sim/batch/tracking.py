"""The tracks of all worlds, as `care_sim.perception.tracker.TrackMemory` keeps those of one."""

from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.batch.scanning import Found
from care_sim.batch.sensor_frames import placed_by, seen_by
from care_sim.batch.state import BatchState, Bodies, Reported, Sensors, TrackTables
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.types import Tracks
from care_sim.perception.tracker import (
    MemoryRules,
    assigned,
    forecast_in_place,
    lived_on,
    possible_pairs,
    seen_nearest_first,
)

_BOX, _BOX_END = Tracks.BOX.start, Tracks.BOX.stop


class Seen(NamedTuple):
    """Tracks in the frame of each sensor, the nearest first: `counts` (W,), `rows` (W, T, 13)."""

    counts: Integers
    rows: Floats


class Tracking:
    """The track memories of all worlds. What `seen` returns it fills anew at the next call."""

    def __init__(self, keyframe_s: float):
        self._keyframe_s = float(keyframe_s)
        self._life = MemoryRules().life(keyframe_s)
        self._seen = np.empty((0, 0, len(Tracks.COLUMNS)))

    def update(self, state: BatchState, found: Found) -> None:
        """Assign what was found in this keyframe to the forecasts, start new tracks, drop old
        ones.
        """
        _make_room(state, found.counts)
        crowded = np.zeros(state.worlds, np.bool_)
        tables = state.bodies, state.reported, state.sensors, state.tracks
        _update(state.live, found, *tables, self._life, crowded)
        for world in np.flatnonzero(crowded).tolist():
            self._update_crowded(state, found, world)

    def predict(self, state: BatchState) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        _predict(state.live, state.tracks, self._keyframe_s)

    def seen(self, state: BatchState, sensors: Sensors | None = None) -> Seen:
        """The tracks from where the `sensors` are, those of the state unless others are given."""
        if self._seen.shape != state.tracks.rows.shape:
            self._seen = np.empty(state.tracks.rows.shape)
        _see(state.live, state.tracks, state.sensors if sensors is None else sensors, self._seen)
        return Seen(state.tracks.counts, self._seen)

    def _update_crowded(self, state: BatchState, found: Found, world: int) -> None:
        """Update the tracks of a world in which one could be two, or two one."""
        rows = found.rows[world, : found.counts[world]]
        classes, boxes = _detected(rows, state.bodies, state.reported, state.sensors, world)
        tracks = state.tracks
        table = tracks.rows[world, : tracks.counts[world]]
        pairs = assigned(table, classes, boxes, self._life)
        _keep(tracks, world, classes, boxes, pairs, self._life)


def _make_room(state: BatchState, new: Integers) -> None:
    """Give the tables as many rows as there will be if nothing that was found is known."""
    tracks = state.tracks
    needed = int((tracks.counts + new).max(initial=0))
    if needed > tracks.rows.shape[1]:
        rows = np.zeros((state.worlds, 2 * needed, tracks.rows.shape[2]))
        rows[:, : tracks.rows.shape[1]] = tracks.rows
        state.tracks = tracks._replace(rows=rows)


@compiled(brief=True)
def _update(
    live: Mask,
    found: Found,
    bodies: Bodies,
    reported: Reported,
    sensors: Sensors,
    tracks: TrackTables,
    life: tuple[float, float, float, float],
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
    life: tuple[float, float, float, float],
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
