"""The timeline of one episode, for a terminal."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from care_sim.study.config import EpisodeConfig
from care_sim.study.episode import Row
from care_sim.types import Keyframe, Outcome


def print_timeline(config: EpisodeConfig, row: Row, keyframes: Sequence[Keyframe], console: Console) -> None:
    """Print an episode keyframe by keyframe, then its outcome."""
    columns = ("time s", "speed m/s", "distance m", "clearance m", "cells fired", "in view", "detected", "braking")
    table = Table(*columns, title=config.label, title_justify="left")
    for column in table.columns[:5]:
        column.justify = "right"
    for frame in keyframes:
        table.add_row(*_cells(frame))
    console.print(table)
    for name in Outcome.__dataclass_fields__:
        console.print(f"{name:22} {_text(row[name])}")
    console.print(f"{'episode_hash':22} {row['episode_hash']}")
    console.print(f"{'wall_s':22} {row['wall_s']:.2f}")


def _cells(frame: Keyframe) -> tuple[str, ...]:
    numbers = (frame.time_s, frame.speed_mps, frame.distance_m, frame.clearance_m)
    flags = (frame.in_view, frame.detected, frame.braking)
    return (*(f"{number:.1f}" for number in numbers), str(len(frame.fired)), *("yes" if flag else "" for flag in flags))


def _text(value: bool | int | float | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
