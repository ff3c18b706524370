"""The events of plays: what each row carries of them, and the table of those of all rows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.evaluation.recall import SceneScore
from care_sim.study.run_config import Row

_EVENT_COLUMNS = ("keyframe", "object", "class", "range_m", "azimuth", "chances")
"""What is known of an event before any policy plays."""
_NAMES = (
    "source",
    "scene",
    "policy",
    "budget",
    "detector",
    "floor_seed",
    "camera_latency",
    "digest",
)
"""Columns by which an event finds its play."""


def event_sightings(score: SceneScore) -> dict[str, list[Any]]:
    """What is known of the events, as columns; metres and radians to three decimals."""
    # Three decimals are millimetres and milliradians, finer than any sensor here.
    rows = score.event_rows()
    columns = {name: [row[name] for row in rows] for name in _EVENT_COLUMNS}
    return {
        name: [round(v, 3) if isinstance(v, float) else v for v in column]
        for name, column in columns.items()
    }


def without_events(row: Row) -> Row:
    """The row without what only its events need."""
    return {name: value for name, value in row.items() if name != "sightings"}


def event_columns(rows: Sequence[Row]) -> dict[str, Any]:
    """The events of all plays as columns of one table: the names of the play, what was seen where,
    and when it was found.
    """
    # One entry per event. The names of a play repeat over its events.
    counts = [len(row["ttfds"]) for row in rows]
    names = {
        name: np.repeat(np.array([row[name] for row in rows], dtype=object), counts)
        for name in _NAMES
    }
    seen = {
        name: [value for row in rows for value in row["sightings"][name]] for name in _EVENT_COLUMNS
    }
    # A TTFD of 0 keyframes is a detection at first sight.
    delays = np.array([delay for row in rows for delay in row["ttfds"]], dtype=np.int64)
    return {**names, **seen, "detected": delays == 0, "ttfd": delays}
