"""The tracks of all worlds, as `care_sim.perception.tracker.TrackMemory` keeps those of one."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, longer
from care_sim.core.types import Tracks
from care_sim.loops.stages.state import Sensors, State, TrackTables, placed_by, seen_by
from care_sim.perception.found import Found
from care_sim.perception.tracker import (
    MemoryRules,
    advance_tracks,
    assign_pairs,
    forecast_in_place,
    possible_pairs,
    sort_by_distance,
)
from care_sim.perception.tracker import Rules as LifeRules

_BOX, _BOX_END = Tracks.BOX.start, Tracks.BOX.stop


class Tracking:
    """The track memories of all worlds. The arrays that `seen` returns are reused at the next
    call.
    """

    def __init__(self, keyframe_s: float, velocity_keyframes: int):
        self._keyframe_s = float(keyframe_s)
        self._life = MemoryRules(velocity_keyframes=velocity_keyframes).life(keyframe_s)
        self._seen = np.empty((0, 0, len(Tracks.COLUMNS)))

    def update(self, state: State, found: Found) -> None:
        """Assign what was found in this keyframe to the forecasts, start new tracks, drop old
        ones, and write the ids of the tracks into `found`.
        """
        # As many rows as there will be if nothing that was found is known.
        needed = int((state.tracks.counts + found.counts).max(initial=0))
        if needed > state.tracks.rows.shape[1]:
            state.tracks = state.tracks._replace(rows=longer(state.tracks.rows, 2 * needed))
        crowded = np.zeros(state.worlds, np.bool_)
        _update(state.live, found, state.taken, state.tracks, self._life, crowded)
        # Where a track could be two or two one, Python assigns.
        for world in np.flatnonzero(crowded).tolist():
            count = found.counts[world]
            classes = found.classes[world, :count]
            boxes = placed_by(state.taken, world, found.boxes[world, :count])
            table = state.tracks.rows[world, : state.tracks.counts[world]]
            pairs = assign_pairs(table, classes, boxes, self._life)
            _keep(state.tracks, world, classes, boxes, pairs, self._life, found.tracks)

    def predict(self, state: State) -> None:
        """Move every track one keyframe ahead at constant velocity."""
        _predict(state.live, state.tracks, self._keyframe_s)

    def seen(self, state: State, sensors: Sensors) -> tuple[Integers, Floats]:
        """Tracks in the frame of each of the `sensors`, the nearest first: how many (W,), and the
        rows (W, T, 13).
        """
        if self._seen.shape != state.tracks.rows.shape:
            self._seen = np.empty(state.tracks.rows.shape)
        _see(state.live, state.tracks, sensors, self._seen)
        return state.tracks.counts, self._seen


@compiled(brief=True)
def _update(
    live: Mask,
    found: Found,
    sensors: Sensors,
    tracks: TrackTables,
    life: LifeRules,
    crowded: Mask,
) -> None:
    """See `Tracking.update`; marks `crowded` (W,) worlds and leaves them alone."""
    for w in range(len(live)):
        if live[w]:
            count = found.counts[w]
            classes = found.classes[w, :count]
            boxes = placed_by(sensors, w, found.boxes[w, :count])
            table = tracks.rows[w, : tracks.counts[w]]
            _, _, pairs, alone = possible_pairs(table, classes, boxes, life)
            if alone:
                _keep(tracks, w, classes, boxes, pairs, life, found.tracks)
            else:
                crowded[w] = True


@compiled(brief=True)
def _keep(
    tracks: TrackTables,
    w: int,
    classes: Integers,
    boxes: Floats,
    pairs: tuple[Integers, Integers],
    life: LifeRules,
    ids: Integers,
) -> None:
    """Let the tracks of a world live on, and write those of its detections into `ids` (W, D)."""
    table = tracks.rows[w, : tracks.counts[w]]
    kept, numbers = advance_tracks(table, classes, boxes, pairs, life, tracks.next_ids[w])
    tracks.rows[w, : len(kept)] = kept
    tracks.counts[w] = len(kept)
    for n in range(len(numbers)):
        ids[w, n] = numbers[n]
        tracks.next_ids[w] = max(tracks.next_ids[w], numbers[n] + 1)


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
            seen[w, : len(table)] = sort_by_distance(table, boxes, turn)
