"""The timeline of one play of the open loop, for a terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from care_sim.base.errors import printable
from care_sim.evaluation.recall import CENSORED_AT, SceneOutcome
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.reports.episodes.timeline import text
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import Row
from care_sim.study.scene_trace import PlayedScene

_COLUMNS = ("time\ns", "objects\nin range", "found", "new", "found\nat once", "rays\nfired")
_LEGEND = (
    "new: objects that newly enter the 50 m around the car: first sightings.\nKeyframes without "
    "one are left out."
)
LABELS = {
    "first_sightings": "first sightings",
    "first_sighting_recall": "found at once %",
    "ttfd_keyframes": "TTFD keyframes",
    "object_frames": "object frames",
    "overall_recall": "found %",
}
"""How the fields of `SceneOutcome` are told."""


def print_scene_timeline(config: PlayConfig, played: PlayedScene, console: Console) -> None:
    """Print a play where somebody appears in it, who was found when, then its outcome."""
    table = Table(
        title=Text(printable(config.label), "table.title"),
        title_justify="left",
        box=None,
        padding=(0, 1, 0, 0),
    )
    for column in _COLUMNS:
        table.add_column(column, justify="right", no_wrap=True)
    for frame in _eventful(played.keyframes):
        table.add_row(*(_cells(frame) if frame else ["..."]))
    console.print(table)
    console.print(_LEGEND, markup=False)
    for line in _sighting_lines(played):
        console.print(line, markup=False)
    for name in SceneOutcome.__dataclass_fields__:
        console.print(f"{LABELS[name]:24} {outcome_text(played.row, name)}")
    console.print(f"{'episode_hash':24} {played.row['episode_hash']}")
    console.print(f"{'wall_s':24} {played.row['wall_s']:.1f}")


def outcome_text(row: Row, name: str) -> str:
    """A field of the outcome as people read it: recalls in percent."""
    value = row[name]
    if value is not None and name.endswith("recall"):
        return f"{100 * value:.1f}"
    return text(value)


def _eventful(keyframes: Sequence[SceneKeyframe]) -> list[SceneKeyframe | None]:
    """First and last keyframe and those with a first sighting; None for every run left out."""
    last = len(keyframes) - 1
    shown: list[SceneKeyframe | None] = []
    for number, frame in enumerate(keyframes):
        if number in (0, last) or frame.entries:
            shown.append(frame)
        elif shown[-1] is not None:
            shown.append(None)
    return shown


def _cells(frame: SceneKeyframe) -> tuple[str, ...]:
    fired = 0 if frame.fired is None else len(frame.fired)
    counts = (frame.objects, frame.objects_found, frame.entries, frame.entries_found, fired)
    return (f"{frame.time_s:.1f}", *map(str, counts))


def _sighting_lines(played: PlayedScene) -> list[str]:
    """A line for every first sighting: when, who, how far, and when it was found."""
    return [
        f"{played.keyframes[event['keyframe']].time_s:5.1f} s  {event['class']} "
        f"{event['object']}, {event['range_m']:.1f} m: {_found(event['ttfd'])}"
        for event in played.score.event_rows()
    ]


def _found(ttfd: int) -> str:
    if ttfd == CENSORED_AT:
        return f"not found within {CENSORED_AT} keyframes"
    if not ttfd:
        return "found at once"
    return f"found {ttfd} keyframe{'s' if ttfd > 1 else ''} later"
