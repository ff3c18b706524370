"""The timeline of one episode of either loop, for a terminal."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from rich.console import Console
from rich.table import Table
from rich.text import Text

from care_sim.base.errors import printable
from care_sim.driving.drivers import brake_delay_s
from care_sim.evaluation.recall import CENSORED_AT, SceneOutcome
from care_sim.loops.open_loop import SceneKeyframe
from care_sim.loops.records import DriveOutcome, Keyframe
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import Row
from care_sim.study.scene_play import PlayedScene

_COLUMNS = (
    "time\ns",
    "speed\nm/s",
    "sensor to\nactor m",
    "hull to\nhull m",
    "rays\nfired",
    "seen",
    "found",
    "brake",
)
_LEGEND = (
    "seen: the camera shows the actor; found: the LiDAR detector reports it; distances are "
    "planar.\nThe brake acts {delay:g} s after the decision. Keyframes in which nothing changes "
    "are left out."
)
_LABELS = {
    "detection_distance_m": "detection_distance_m (sensor to actor)",
    "min_distance_m": "min_distance_m (ego centre to actor centre)",
    "clearance_m": "clearance_m (hull to hull)",
}
_SCENE_COLUMNS = ("time\ns", "objects\nin range", "found", "new", "found\nat once", "rays\nfired")
_SCENE_LEGEND = (
    "new: objects that newly enter the 50 m around the car: first sightings.\nKeyframes without "
    "one are left out."
)
SCENE_LABELS = {
    "first_sightings": "first sightings",
    "first_sighting_recall": "found at once %",
    "ttfd_keyframes": "TTFD keyframes",
    "object_frames": "object frames",
    "overall_recall": "found %",
}
"""Labels of the fields of `SceneOutcome`."""
_Frame = TypeVar("_Frame")


@dataclass(frozen=True)
class Timeline:
    """Timeline of an episode: one of the `lines` per keyframe, None where some are left out,
    `events`, and the outcome as people read it, by its labels. The last columns, `words` of them,
    hold words.
    """

    title: str
    columns: tuple[str, ...]
    words: int
    lines: list[tuple[str, ...] | None]
    legend: str
    events: list[str]
    row: Row
    outcome: dict[str, str]

    def print(self, console: Console) -> None:
        """Print the keyframes, what happened, then the outcome."""
        title = Text(printable(self.title), "table.title")
        table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
        for number, column in enumerate(self.columns):
            numeric = number < len(self.columns) - self.words
            table.add_column(column, justify="right" if numeric else "left", no_wrap=True)
        for line in self.lines:
            table.add_row(*(line or ["..."]))
        console.print(table)
        for text in (self.legend, *self.events):
            console.print(text, markup=False)
        ending = {"episode_hash": self.row["episode_hash"], "wall_s": f"{self.row['wall_s']:.1f}"}
        told = self.outcome | ending
        width = max(len(label) for label in told)
        for label, value in told.items():
            console.print(f"{label:{width}}  {value}")


def episode_timeline(config: EpisodeConfig, row: Row, keyframes: Sequence[Keyframe]) -> Timeline:
    """Return the timeline of an episode of the closed loop, with the keyframes at which something
    changes.
    """
    states = [(f.in_view, f.detected, f.braking, f.impact_speed_mps is not None) for f in keyframes]
    # A change, and the keyframe before it.
    changes = [n for n in range(1, len(states)) if states[n] != states[n - 1]]
    frames = with_gaps(keyframes, [*changes, *(n - 1 for n in changes)])
    encounters = enumerate(row.get("encounters", ()), 1)
    # The seed's draws, and the outcome; for a drive the whole outcome without its encounters.
    drawn = [name for name in row if name.startswith("drawn.")]
    told = [*drawn, *(name for name in DriveOutcome.__dataclass_fields__ if name != "encounters")]
    return Timeline(
        config.label,
        _COLUMNS,
        3,
        [_cells(frame) if frame else None for frame in frames],
        _LEGEND.format(delay=brake_delay_s(config)),
        [f"encounter {number}: {encounter_text(each, keyframes)}" for number, each in encounters],
        row,
        {_LABELS.get(name, name): text(row[name]) for name in told if name in row},
    )


def scene_timeline(config: PlayConfig, played: PlayedScene) -> Timeline:
    """Return the timeline of a play of the open loop: appearing objects, and their detections."""
    row, keyframes, score = played
    frames = with_gaps(keyframes, [n for n, frame in enumerate(keyframes) if frame.entries])
    return Timeline(
        config.label,
        _SCENE_COLUMNS,
        0,
        [_cells(frame) if frame else None for frame in frames],
        _SCENE_LEGEND,
        [
            f"{keyframes[event['keyframe']].time_s:5.1f} s  {event['class']} "
            f"{event['object']}, {event['range_m']:.1f} m: {_found(event['ttfd'])}"
            for event in score.event_rows()
        ],
        row,
        {SCENE_LABELS[name]: outcome_text(row, name) for name in SceneOutcome.__dataclass_fields__},
    )


def with_gaps(keyframes: Sequence[_Frame], events: Iterable[int]) -> list[_Frame | None]:
    """First and last keyframe and those with the numbers of `events`; None for every run left
    out.
    """
    # The intersection drops the ends of an episode without keyframes.
    kept = sorted({0, len(keyframes) - 1, *events} & set(range(len(keyframes))))
    shown: list[_Frame | None] = []
    for before, n in zip([-1, *kept], kept, strict=False):
        shown += [keyframes[n]] if n == before + 1 else [None, keyframes[n]]
    return shown


def encounter_text(encounter: Row, keyframes: Sequence[Keyframe]) -> str:
    """Return who came, from where, and how the encounter ended. `encounter` holds the fields of
    `care_sim.loops.records.EncounterOutcome`, times are those of the `keyframes`.
    """
    known = "reported" if encounter["occluder_reported"] else "unreported"
    who = (
        f"{encounter['who']} from the {encounter['side']} ({encounter['course']}, "
        f"{encounter['way']}), behind {encounter['occluder']} ({known})"
    )
    if not encounter["set_off"]:
        return f"{who}: never set off"
    seen, found = encounter["view_keyframe"], encounter["detection_keyframe"]
    told = [
        "never in view" if seen is None else f"in view at {keyframes[seen].time_s:.1f} s",
        "not detected"
        if found is None
        else f"detected at {keyframes[found].time_s:.1f} s, "
        f"{encounter['detection_distance_m']:.1f} m",
        *(["hit"] if encounter["hit"] else []),
    ]
    return f"{who}: {'; '.join(told)}"


def _cells(frame: Keyframe | SceneKeyframe) -> tuple[str, ...]:
    fired = 0 if frame.fired is None else len(frame.fired)
    if isinstance(frame, SceneKeyframe):
        counts = (frame.objects, frame.objects_found, frame.entries, frame.entries_found, fired)
        return (f"{frame.time_s:.1f}", *map(str, counts))
    numbers = (frame.time_s, frame.speed_mps, frame.distance_m, frame.clearance_m)
    flags = (frame.in_view, frame.detected, frame.braking)
    words = ("yes" if flag else "" for flag in flags)
    return (*(f"{number:z.1f}" for number in numbers), str(fired), *words)


def _found(ttfd: int) -> str:
    if ttfd == CENSORED_AT:
        return f"not found within {CENSORED_AT} keyframes"
    if not ttfd:
        return "found at once"
    return f"found {ttfd} keyframe{'s' if ttfd > 1 else ''} later"


def outcome_text(row: Row, name: str) -> str:
    """Return a field of a play's outcome as text: recalls in percent."""
    value = row[name]
    if value is not None and name.endswith("recall"):
        return f"{100 * value:.1f}"
    return text(value)


def text(value: bool | int | float | None) -> str:
    """Return a result as text."""
    if value is None:
        return "-"
    # Before numbers: bool is a subclass of int.
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:z.2f}" if isinstance(value, float) else str(value)
