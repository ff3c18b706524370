"""The timeline of one episode, for a terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from care_sim.base.errors import printable
from care_sim.driving.drivers import brake_delay_s
from care_sim.loops.records import DriveOutcome, Keyframe
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.run_config import Row

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


def print_timeline(
    config: EpisodeConfig, row: Row, keyframes: Sequence[Keyframe], console: Console
) -> None:
    """Print an episode where something changes in it, then its outcome."""
    table = Table(
        title=Text(printable(config.label), "table.title"),
        title_justify="left",
        box=None,
        padding=(0, 1, 0, 0),
    )
    for number, column in enumerate(_COLUMNS):
        table.add_column(column, justify="right" if number < 5 else "left", no_wrap=True)
    for frame in eventful(keyframes):
        table.add_row(*(_cells(frame) if frame else ["..."]))
    console.print(table)
    console.print(_LEGEND.format(delay=brake_delay_s(config)), markup=False)
    for name in _told(row):
        console.print(f"{_LABELS.get(name, name):44} {text(row[name])}")
    for number, encounter in enumerate(row.get("encounters", ()), 1):
        line = f"encounter {number}: {encounter_text(encounter, keyframes)}"
        console.print(line, markup=False)
    console.print(f"{'episode_hash':44} {row['episode_hash']}")
    console.print(f"{'wall_s':44} {row['wall_s']:.1f}")


def _told(row: Row) -> list[str]:
    """The columns that are shown: what the seed drew, and the outcome, of a drive the whole one
    but for its encounters.
    """
    drawn = [name for name in row if name.startswith("drawn.")]
    outcome = [name for name in DriveOutcome.__dataclass_fields__ if name != "encounters"]
    return [*drawn, *(name for name in outcome if name in row)]


def encounter_text(encounter: Row, keyframes: Sequence[Keyframe]) -> str:
    """Who came, from where, and what came of it. `encounter` holds the fields of
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


def eventful(keyframes: Sequence[Keyframe]) -> list[Keyframe | None]:
    """First and last keyframe and those about a change of state; None for every run left out."""
    states = [(f.in_view, f.detected, f.braking, f.impact_speed_mps is not None) for f in keyframes]
    last = len(states) - 1
    # A change, the keyframe before it, and both ends of the episode. The intersection drops what
    # lies outside.
    changes = [n for n in range(1, last + 1) if states[n] != states[n - 1]]
    kept = sorted({0, last, *changes, *(n - 1 for n in changes)} & set(range(last + 1)))
    shown: list[Keyframe | None] = []
    for before, n in zip([-1, *kept], kept, strict=False):
        # A gap between two kept keyframes is one line of dots, however long it is.
        shown += [keyframes[n]] if n == before + 1 else [None, keyframes[n]]
    return shown


def _cells(frame: Keyframe) -> tuple[str, ...]:
    numbers = (frame.time_s, frame.speed_mps, frame.distance_m, frame.clearance_m)
    flags = (frame.in_view, frame.detected, frame.braking)
    return (
        *(f"{number:z.1f}" for number in numbers),
        str(len(frame.fired)),
        *("yes" if flag else "" for flag in flags),
    )


def text(value: bool | int | float | None) -> str:
    """A result as people read it."""
    if value is None:
        return "-"
    # Before numbers: bool is a subclass of int.
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:z.2f}" if isinstance(value, float) else str(value)
