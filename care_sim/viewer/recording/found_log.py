"""What is logged of a play of the open loop as curves and words: who is found, the budget."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr

from care_sim.core.boxes import planar_ranges
from care_sim.loops.film_watcher import WatchedScene
from care_sim.viewer.recording.lane import Lane
from care_sim.viewer.recording.measure_log import BudgetLog, log_outcome

_CURVES = {"objects": "objects", "found": "objects_found"}
"""The measures, and the properties of `SceneKeyframe` that they show."""


class FoundLog:
    """Logs the numbers of a play as curves in the colour of its lane, and its first sightings as
    events; `budget` is B in cells.
    """

    def __init__(self, lane: Lane, budget: int, colour: tuple[int, int, int]):
        self._lane = lane
        self._budget = BudgetLog(lane, budget)
        self._watched: list[WatchedScene] = []
        for name in _CURVES:
            series = rr.SeriesLines(names=f"{lane.name} {name}", colors=colour)
            lane.fix(f"measures/{name}", series)

    def log(self, watched: WatchedScene) -> None:
        """A keyframe."""
        record = watched.record
        assert record.fired is not None
        self._watched.append(watched)
        self._budget.count(watched, record.fired)
        situation = watched.situation
        ranges = planar_ranges(situation.sensor.boxes_to_local(situation.bodies))
        for row in np.flatnonzero(record.appearing).tolist():
            state = "found at once" if record.found[row] else "not found yet"
            words = f"{situation.names[row]} appears, {ranges[row]:.1f} m from the sensor: {state}"
            self._lane.log("events", rr.TextLog(words))

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log the curves and the result of the play, None where it was left unfinished."""
        records = [watched.record for watched in self._watched]
        times = [record.index for record in records], [record.time_s for record in records]
        for name, told in _CURVES.items():
            values = np.array([getattr(record, told) for record in records], float)
            self._lane.log_curve(f"measures/{name}", *times, values)
        self._budget.end(*times)
        log_outcome(self._lane, outcome)
