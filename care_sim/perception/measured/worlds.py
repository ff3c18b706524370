"""A measured detector in many worlds at once."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.threads import Threads
from care_sim.core.arrays import Floats, Integers, Mask, longer
from care_sim.core.cells.stack import Grid
from care_sim.perception.found import Found
from care_sim.perception.measured.candidates import COLUMNS, Candidates, Kinds, advance_candidates
from care_sim.perception.measured.false_boxes import View, report_false_boxes, view_of
from care_sim.perception.measured.luck import Memory
from care_sim.perception.measured.reporting import Rules, report_objects

_OBJECTS, _CANDIDATES = 32, 64
"""Rows with which tables begin; they grow."""
Clock = tuple[Integers, Integers]
"""The seeds (W,) and the coming keyframes (W,) of episodes."""
Present = tuple[Integers, Integers, Integers, Floats]
"""The present objects of W worlds: `counts` (W,) of them, their numbers (W, R), classes (W, R), and
boxes (W, R, 7) in the sensor frames.
"""
Returned = tuple[Integers, Integers, Integers]
"""Returns of W worlds: `counts` (W,), ascending cells (W, F) and the objects behind them (W, F)."""
Ranged = tuple[Integers, Integers, Floats]
"""Returns of W worlds: `counts` (W,), cells (W, F) and ranges (W, F), inf without a return."""


class MeasuredWorlds:
    """A measured detector in `worlds` worlds, which `threads` share. Call `advance` once per
    keyframe, then `report`.
    """

    def __init__(self, rules: Rules, grid: Grid, worlds: int, threads: Threads):
        self._rules, self._grid, self._threads = rules, grid, threads
        self.clock = np.zeros(worlds, np.uint64), np.zeros(worlds, np.int64)
        rows = np.zeros((worlds, _CANDIDATES, COLUMNS))
        self._candidates = Candidates(np.zeros(worlds, np.int64), rows, np.empty((worlds, 2)))
        self.memory = Memory.of(worlds, _OBJECTS, len(rules.weights))

    def begin(self, world: int, seed: np.random.SeedSequence, objects: int = 0) -> None:
        """Begin an episode, in which so many objects are present from the start on, by ascending
        number.
        """
        self.clock[0][world], self.clock[1][world] = seed.generate_state(1, np.uint64)[0], 0
        self._candidates.counts[world], self._candidates.before[world] = 0, np.nan
        self.make_room(objects)
        fresh = Memory.of(1, self.memory.first.shape[1], len(self._rules.weights))
        for table, (row,) in zip(self.memory, fresh, strict=True):
            table[world] = row

    def make_room(self, objects: int) -> None:
        """Have room for so many objects."""
        known = self.memory
        if objects > (room := known.first.shape[1]):
            self.memory = Memory.of(len(known.first), 2 * objects, len(self._rules.weights))
            for table, old in zip(self.memory, known, strict=True):
                table[:, :room] = old

    def advance(self, live: Mask, places: Floats) -> Candidates:
        """Advance the candidates for false boxes in the worlds that are `live` (W,), whose sensors
        are at `places` (W, 2 or more). Before `report`, the caller fills in their boxes in the
        sensor frames.
        """
        needed = np.zeros(len(live), np.int64)
        while live.any():
            given = self.clock, places, self._candidates, self._rules.kinds, needed
            self._threads.share(_advance, live, *given)
            rows = self._candidates.rows
            live = live & (needed > rows.shape[1])
            if live.any():
                rows = longer(rows, 2 * int(needed.max()))
                self._candidates = self._candidates._replace(rows=rows)
        return self._candidates

    def report(
        self,
        live: Mask,
        present: Present,
        returned: Returned,
        newest: Ranged,
        found: Found,
        sweeps: int = 1,
    ) -> Found:
        """Write what is reported of the `present` objects, and false boxes, into `found`, or into
        longer tables, in the worlds that are `live` (W,). All `sweeps` have `returned`
        these. The `newest` one alone shows false boxes, since cells are in its sensor frame.
        """
        found = found.with_room(present[1].shape[1] + self._candidates.rows.shape[1])
        view = view_of(self._grid, self._rules.sensor_height_m)
        given = self.clock, present, (*returned, sweeps), newest
        tables = self._candidates, view, self.memory, self._rules, found
        self._threads.share(_report, live, *given, *tables)
        return found


@compiled()
def _advance(
    live: Mask,
    clock: Clock,
    places: Floats,
    candidates: Candidates,
    kinds: Kinds,
    needed: Integers,
) -> None:
    """See `MeasuredWorlds.advance`; `needed` (W,) are rows."""
    for w in range(len(live)):
        if live[w]:
            now, place = (clock[0][w], clock[1][w]), (places[w, 0], places[w, 1])
            needed[w] = advance_candidates(w, now, place, candidates, kinds)


@compiled()
def _report(
    live: Mask,
    clock: Clock,
    present: Present,
    returned: tuple[Integers, Integers, Integers, int],
    newest: Ranged,
    candidates: Candidates,
    view: View,
    memory: Memory,
    rules: Rules,
    found: Found,
) -> None:
    """See `MeasuredWorlds.report`."""
    seeds, keyframes = clock
    farthest = np.zeros(len(view.cells))
    for w in range(len(live)):
        if not live[w]:
            continue
        own, sent, count = present[0][w], returned[0][w], newest[0][w]
        classes, boxes = present[2][w, :own], present[3][w, :own]
        there = present[1][w, :own], classes, boxes
        swept = returned[1][w, :sent], returned[2][w, :sent], returned[3]
        clock_here = seeds[w], keyframes[w]
        report_objects(w, clock_here, there, swept, view.firsts, memory, rules, found)
        keyframes[w] += 1

        cells, ranges = newest[1][w, :count], newest[2][w, :count]
        for n in range(count):
            if np.isfinite(ranges[n]):
                farthest[cells[n]] = max(farthest[cells[n]], ranges[n])
        report_false_boxes(w, candidates, (classes, boxes), farthest, view, rules, found)
        for n in range(count):
            farthest[cells[n]] = 0.0
