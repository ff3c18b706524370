"""What is logged as curves, states and words: speed, distances, the budget, what happened when."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from rerun.components import InterpolationMode

from care_sim.core.actions import ALONG, CHOSEN, EXPLOITATION, FLOOR, RESERVE, SHARES
from care_sim.core.arrays import Floats
from care_sim.core.grid import Cells
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import Watched, WatchedKeyframe
from care_sim.viewer.recording import entities
from care_sim.viewer.recording.lane import Lane

_UNITS = {"speed": "m/s", "distance": "m", "clearance": "m", "braking": ""}
_FIELDS = {
    "speed": "speed_mps",
    "distance": "distance_m",
    "clearance": "clearance_m",
    "braking": "braking",
}


class BudgetLog:
    """Counts the shares of a budget of B cells, and logs them as curves at the end."""

    def __init__(self, lane: Lane, budget: int):
        self._lane = lane
        self._budget = budget
        self._counts: list[Cells] = []
        for name, colour in zip(SHARES[1:], entities.SHARE_COLOURS[1:], strict=True):
            lane.fix(f"budget/{name}", rr.SeriesLines(names=f"{name} %", colors=colour))

    def count(self, watched: Watched, fired: Cells) -> None:
        """Count the cells of a keyframe; one that was fired several times was paid for as often."""
        paid = watched.shares.ravel()[fired]
        self._counts.append(np.bincount(paid, minlength=len(SHARES)))

    def end(self, keyframes: Sequence[int], times_s: Sequence[float]) -> None:
        """Log the curves of the shares that there are."""
        percents = 100 * np.reshape(self._counts, (-1, len(SHARES))) / self._budget
        # Either a policy's demand tells the shares, or a raw action scored the cells itself.
        asked = (CHOSEN,) if percents[:, CHOSEN].any() else (EXPLOITATION, RESERVE)
        for share in (*asked, ALONG if percents[:, ALONG].any() else FLOOR):
            self._lane.log_curve(f"budget/{SHARES[share]}", keyframes, times_s, percents[:, share])


def log_outcome(lane: Lane, outcome: Mapping[str, Any] | None) -> None:
    """Log the result of an episode, None where it was left unfinished."""
    lines = [
        f"| {name} | {'-' if value is None else value} |" for name, value in (outcome or {}).items()
    ]
    text = (
        "\n".join(["| outcome | |", "|---|---|", *lines])
        if outcome
        else "The episode was not finished."
    )
    lane.fix("outcome", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


class MeasureLog:
    """Logs the numbers of an episode as curves in the colour of its lane, its states and its
    events; `budget` is B in cells.
    """

    def __init__(self, lane: Lane, budget: int, colour: tuple[int, int, int]):
        self._lane = lane
        self._budget = BudgetLog(lane, budget)
        self._states: dict[str, str] = {}
        self._frames: list[Keyframe] = []
        for name, unit in _UNITS.items():
            step = InterpolationMode.StepAfter if name == "braking" else InterpolationMode.Linear
            series = rr.SeriesLines(
                names=f"{lane.name} {name} {unit}".strip(), colors=colour, interpolation_mode=step
            )
            lane.fix(f"measures/{name}", series)

        # States with a name and a colour for each of their values.
        actor = entities.ACTOR_COLOURS
        brake = {"off": entities.COASTING_RGB, "on": entities.BRAKE_RGB}
        for entity, colours in (("states/actor", actor), ("states/brake", brake)):
            values = list(colours)
            lane.fix(
                entity,
                rr.StateConfiguration(values=values, labels=values, colors=list(colours.values())),
            )

    def log(self, watched: WatchedKeyframe, state: str) -> None:
        """A keyframe, with the state of the first-sighting actor."""
        frame = watched.record
        self._frames.append(frame)
        self._budget.count(watched, frame.fired)
        brake = "on" if frame.braking else "off"
        self._change(
            "states/actor", state, f"actor {state}, {frame.distance_m:.1f} m from the sensor"
        )
        self._change("states/brake", brake, f"brake {brake} at {frame.speed_mps:.1f} m/s")
        if frame.impact_speed_mps is not None:
            self._lane.log("events", rr.TextLog(f"collision at {frame.impact_speed_mps:.1f} m/s"))

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log the curves and the result of the episode, None where it was left unfinished."""
        self._log_curves()
        log_outcome(self._lane, outcome)

    def _log_curves(self) -> None:
        frames = self._frames
        for name, field in _FIELDS.items():
            self._log_curve(
                f"measures/{name}", np.array([getattr(frame, field) for frame in frames], float)
            )
        self._budget.end([frame.index for frame in frames], [frame.time_s for frame in frames])

    def _log_curve(self, entity: str, values: Floats) -> None:
        # Without a first-sighting actor there is no distance, and no point of the curve.
        kept = np.flatnonzero(np.isfinite(values))
        frames = [self._frames[number] for number in kept]
        self._lane.log_curve(
            entity, [f.index for f in frames], [f.time_s for f in frames], values[kept]
        )

    def _change(self, entity: str, state: str, words: str) -> None:
        before = self._states.get(entity)
        if state == before:
            return
        self._states[entity] = state
        # What an episode begins with is no event, unless it is worth telling.
        self._lane.log(entity, rr.StateChange(state=state))
        if before is not None or state not in ("off", "out of view"):
            self._lane.log("events", rr.TextLog(words))
