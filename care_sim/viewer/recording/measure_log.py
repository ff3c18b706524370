"""Logs of curves, states and events: measures, budget, and when things happened."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from rerun.components import InterpolationMode

from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.firing.actions import ALONG, CHOSEN, EXPLOITATION, FLOOR, RESERVE, SHARES
from care_sim.loops.open_loop import SceneKeyframe
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import TrueSituation, Watched
from care_sim.viewer import palette
from care_sim.viewer.recording.lane import Lane

_CLOSED_LOOP = {"speed": "m/s", "distance": "m", "clearance": "m", "braking": ""}
_OPEN_LOOP = {"objects": "", "found": ""}
"""Measures of either loop with their units."""
_STATES = {
    "actor": dict([palette.OUT_OF_VIEW, palette.IN_VIEW, palette.DETECTED]),
    "brake": {"off": palette.COASTING_COLOUR, "on": palette.BRAKING_COLOUR},
}
"""States of the closed loop with a colour for each of their values."""
_QUIET = ("off", "out of view")
"""Initial states that are not logged as events."""


def actor_state(frame: Keyframe) -> palette.State:
    """Return the state of the first-sighting actor at the scan."""
    if frame.detected:
        return palette.DETECTED
    return palette.IN_VIEW if frame.in_view else palette.OUT_OF_VIEW


class MeasureLog:
    """Logs the numbers of an episode as curves in the colour of its lane, its states and its
    events; `budget` is B in cells.
    """

    def __init__(self, lane: Lane, budget: int, colour: palette.Colour, open_loop: bool):
        self._lane = lane
        self._budget = budget
        self._states: dict[str, str] = {}
        self._times: list[tuple[int, float]] = []
        self._paid: list[Any] = []
        units = _OPEN_LOOP if open_loop else _CLOSED_LOOP
        self._measures: dict[str, list[float]] = {name: [] for name in units}
        for name, share in zip(SHARES[1:], palette.SHARE_COLOURS[1:].tolist(), strict=True):
            lane.fix(f"budget/{name}", rr.SeriesLines(names=f"{name} %", colors=share))
        for name, unit in units.items():
            step = InterpolationMode.StepAfter if name == "braking" else InterpolationMode.Linear
            label = f"{lane.name} {name} {unit}".strip()
            look = rr.SeriesLines(names=label, colors=colour, interpolation_mode=step)
            lane.fix(f"measures/{name}", look)
        for name, states in {} if open_loop else _STATES.items():
            values, colours = list(states), list(states.values())
            lane.fix(
                f"states/{name}",
                rr.StateConfiguration(values=values, labels=values, colors=colours),
            )

    def log(self, watched: Watched) -> None:
        """Log a keyframe."""
        record = watched.record
        self._times.append((record.index, record.time_s))
        # A cell that was fired several times was paid for as often.
        paid = watched.shares.ravel()[watched.fired]
        self._paid.append(np.bincount(paid, minlength=len(SHARES)))
        if isinstance(record, Keyframe):
            self._log_episode(record)
        else:
            self._log_play(record, watched.situation)

    def _log_episode(self, frame: Keyframe) -> None:
        self._measure(
            speed=frame.speed_mps,
            distance=frame.distance_m,
            clearance=frame.clearance_m,
            braking=float(frame.braking),
        )
        state, brake = actor_state(frame).words, "on" if frame.braking else "off"
        far = f"{frame.distance_m:.1f} m from the sensor"
        self._change("actor", state, f"actor {state}, {far}")
        self._change("brake", brake, f"brake {brake} at {frame.speed_mps:.1f} m/s")
        if frame.impact_speed_mps is not None:
            self._event(f"collision at {frame.impact_speed_mps:.1f} m/s")

    def _log_play(self, frame: SceneKeyframe, situation: TrueSituation) -> None:
        self._measure(objects=frame.objects, found=frame.objects_found)
        ranges = planar_ranges(situation.sensor.boxes_to_local(situation.bodies))
        for row in np.flatnonzero(frame.appearing).tolist():
            found = "found at once" if frame.found[row] else "not found yet"
            far = f"{ranges[row]:.1f} m from the sensor"
            self._event(f"{situation.names[row]} appears, {far}: {found}")

    def _measure(self, **values: float) -> None:
        for name, value in values.items():
            self._measures[name].append(value)

    def _change(self, name: str, state: str, words: str) -> None:
        """Log a state, and its beginning as an event."""
        before = self._states.get(name)
        if state == before:
            return
        self._states[name] = state
        self._lane.log(f"states/{name}", rr.StateChange(state=state))
        if before is not None or state not in _QUIET:
            self._event(words)

    def _event(self, words: str) -> None:
        self._lane.log("events", rr.TextLog(words))

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log the curves and the result of the episode, None where it was left unfinished."""
        for name, measures in self._measures.items():
            values = np.array(measures, float)
            # Without a first-sighting actor there is no distance, and no point of the curve.
            kept = np.flatnonzero(np.isfinite(values))
            times = [self._times[n] for n in kept.tolist()]
            self._lane.log_curve(f"measures/{name}", times, values[kept])
        percents = 100 * np.reshape(self._paid, (-1, len(SHARES))) / self._budget
        # Shares come from a policy's demand, or from a raw action that scored the cells itself.
        asked = (CHOSEN,) if percents[:, CHOSEN].any() else (EXPLOITATION, RESERVE)
        for share in (*asked, ALONG if percents[:, ALONG].any() else FLOOR):
            self._lane.log_curve(f"budget/{SHARES[share]}", self._times, percents[:, share])
        lines = [f"| {name} | {'-' if v is None else v} |" for name, v in (outcome or {}).items()]
        table = "\n".join(["| outcome | |", "|---|---|", *lines])
        text = table if outcome else "The episode was not finished."
        self._lane.fix("outcome", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
