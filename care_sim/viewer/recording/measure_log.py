"""What is logged as curves, states and words: the measures, the budget, what happened when."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from rerun.components import InterpolationMode

from care_sim.core.actions import ALONG, CHOSEN, EXPLOITATION, FLOOR, RESERVE, SHARES
from care_sim.core.boxes import planar_ranges
from care_sim.loops.records import Keyframe
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.loops.watcher import TrueSituation, Watched
from care_sim.viewer import palette
from care_sim.viewer.recording.lane import Lane

_UNITS = {"speed": "m/s", "distance": "m", "clearance": "m"}
_STATES = {
    "actor": dict([palette.OUT_OF_VIEW, palette.IN_VIEW, palette.DETECTED]),
    "brake": {"off": palette.COASTING_COLOUR, "on": palette.BRAKING_COLOUR},
}
"""States with a colour for each of their values."""
_QUIET = ("off", "out of view")
"""What an episode begins with is no event, unless it is worth telling."""


class Told(NamedTuple):
    """What a keyframe of either loop tells in numbers and words."""

    measures: dict[str, float]
    """By the name of their curve, which has no point where they are not finite."""
    states: dict[str, tuple[str, str]]
    """The state, and the event that it is when it begins."""
    events: list[str]


def actor_state(frame: Keyframe) -> palette.State:
    """How it stands with the first-sighting actor at the scan."""
    if frame.detected:
        return palette.DETECTED
    return palette.IN_VIEW if frame.in_view else palette.OUT_OF_VIEW


def _of_episode(frame: Keyframe) -> Told:
    measures = {
        "speed": frame.speed_mps,
        "distance": frame.distance_m,
        "clearance": frame.clearance_m,
        "braking": float(frame.braking),
    }
    state, brake = actor_state(frame).words, "on" if frame.braking else "off"
    states = {
        "actor": (state, f"actor {state}, {frame.distance_m:.1f} m from the sensor"),
        "brake": (brake, f"brake {brake} at {frame.speed_mps:.1f} m/s"),
    }
    impact = frame.impact_speed_mps
    return Told(measures, states, [] if impact is None else [f"collision at {impact:.1f} m/s"])


def _of_play(frame: SceneKeyframe, situation: TrueSituation) -> Told:
    measures = {"objects": float(frame.objects), "found": float(frame.objects_found)}
    ranges = planar_ranges(situation.sensor.boxes_to_local(situation.bodies))
    events = [
        f"{situation.names[row]} appears, {ranges[row]:.1f} m from the sensor: "
        f"{'found at once' if frame.found[row] else 'not found yet'}"
        for row in np.flatnonzero(frame.appearing).tolist()
    ]
    return Told(measures, {}, events)


class MeasureLog:
    """Logs the numbers of an episode as curves in the colour of its lane, its states and its
    events; `budget` is B in cells.
    """

    def __init__(self, lane: Lane, budget: int, colour: palette.Colour):
        self._lane = lane
        self._budget = budget
        self._colour = colour
        self._states: dict[str, str] = {}
        self._times: list[tuple[int, float]] = []
        self._measures: dict[str, list[float]] = {}
        self._paid: list[Any] = []
        for name, share in zip(SHARES[1:], palette.SHARE_COLOURS[1:].tolist(), strict=True):
            lane.fix(f"budget/{name}", rr.SeriesLines(names=f"{name} %", colors=share))

    def log(self, watched: Watched) -> None:
        """A keyframe."""
        record = watched.record
        told = (
            _of_episode(record)
            if isinstance(record, Keyframe)
            else _of_play(record, watched.situation)
        )
        if not self._times:
            self._begin(told)
        self._times.append((record.index, record.time_s))
        for name, value in told.measures.items():
            self._measures[name].append(value)
        # A cell that was fired several times was paid for as often.
        paid = watched.shares.ravel()[watched.fired]
        self._paid.append(np.bincount(paid, minlength=len(SHARES)))
        for name, (state, words) in told.states.items():
            before = self._states.get(name)
            if state != before:
                self._states[name] = state
                self._lane.log(f"states/{name}", rr.StateChange(state=state))
                if before is not None or state not in _QUIET:
                    self._lane.log("events", rr.TextLog(words))
        for words in told.events:
            self._lane.log("events", rr.TextLog(words))

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Log the curves and the result of the episode, None where it was left unfinished."""
        for name, measures in self._measures.items():
            values = np.array(measures)
            # Without a first-sighting actor there is no distance, and no point of the curve.
            kept = np.flatnonzero(np.isfinite(values))
            self._lane.log_curve(
                f"measures/{name}", [self._times[n] for n in kept.tolist()], values[kept]
            )
        percents = 100 * np.reshape(self._paid, (-1, len(SHARES))) / self._budget
        # Either a policy's demand tells the shares, or a raw action scored the cells itself.
        asked = (CHOSEN,) if percents[:, CHOSEN].any() else (EXPLOITATION, RESERVE)
        for share in (*asked, ALONG if percents[:, ALONG].any() else FLOOR):
            self._lane.log_curve(f"budget/{SHARES[share]}", self._times, percents[:, share])
        lines = [f"| {name} | {'-' if v is None else v} |" for name, v in (outcome or {}).items()]
        table = "\n".join(["| outcome | |", "|---|---|", *lines])
        text = table if outcome else "The episode was not finished."
        self._lane.fix("outcome", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))

    def _begin(self, told: Told) -> None:
        """Say what the curves and states of this episode look like."""
        for name in told.measures:
            self._measures[name] = []
            step = InterpolationMode.StepAfter if name == "braking" else InterpolationMode.Linear
            label = f"{self._lane.name} {name} {_UNITS.get(name, '')}".strip()
            series = rr.SeriesLines(names=label, colors=self._colour, interpolation_mode=step)
            self._lane.fix(f"measures/{name}", series)
        for name in told.states:
            values, colours = list(_STATES[name]), list(_STATES[name].values())
            look = rr.StateConfiguration(values=values, labels=values, colors=colours)
            self._lane.fix(f"states/{name}", look)
