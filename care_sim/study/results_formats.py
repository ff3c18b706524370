"""The kinds of results, how each is played and stored. Kinds: episodes of the closed loop, episodes
of the vehicle study, plays of the open loop, and plays with an account of their rays.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from care_sim.core.conditions import COLUMNS_WHERE_CHANGED, OF_BOTH_LOOPS
from care_sim.loops.records import DriveOutcome
from care_sim.study.episode_config import PLAIN_FIELDS, listed_episodes
from care_sim.study.episode_play import MOST_TOGETHER, play_episodes
from care_sim.study.mechanism_play import (
    ACCOUNT_COLUMNS,
    BELIEF_MARKS,
    BELIEF_SUMS,
    DIFFERING,
    RECEIVED,
    play_mechanism,
)
from care_sim.study.play_config import PLAY_FIELDS, listed_plays
from care_sim.study.rows.reading import READ_WITH, with_added_columns, with_tags
from care_sim.study.rows.schema import (
    CONDITION_COLUMNS,
    COUNT,
    FLAG,
    MEASURE,
    PARAMETERS,
    SEED,
    SHARE,
    SUM,
    TALLY,
    TEXT,
    Column,
    Schema,
    as_optional,
)
from care_sim.study.run_config import Row
from care_sim.study.runner import PlayBatch
from care_sim.study.scene_play import DECISION_MS, SUMS, event_columns, play_scene
from care_sim.study.vehicle_play import (
    VEHICLE_COUNTS,
    VEHICLE_LISTS,
    VEHICLE_MEASURES,
    play_vehicle,
)


@dataclass(frozen=True)
class ResultsFormat:
    """How one kind of results is played and stored.

    `file` holds the stored rows, in columns of the `schema`.
    """

    task: str
    """Name of a task."""
    play_batch: PlayBatch
    """Plays a batch of tasks."""
    most: int | None
    """Most tasks of a batch; None keeps all tasks together that share something."""
    kept_rows: Callable[[Sequence[Row]], list[Row]]
    """Makes the stored rows from all played rows: some columns compare a row with others."""
    file: str
    schema: Schema
    listed: Callable[[Any], dict[str, Any]]
    """Converts configurations to plain data."""
    further_files: Callable[[Sequence[Row]], dict[str, dict[str, Any]]] = lambda _rows: {}
    """Makes columns by file name from the played rows."""

    @property
    def unit(self) -> str:
        """Return the name of its tasks."""
        return f"{self.task}s"


_BY_WRITER = {
    "version": as_optional(TEXT),
    "digest": as_optional(TEXT),
    "episode_hash": as_optional(TEXT),
    "tags": as_optional(TEXT),
    "sensor": as_optional(TEXT),
    "sensor_hash": as_optional(TEXT),
    "sensor_setup": as_optional(TEXT),
    "cell_order": CONDITION_COLUMNS["cell_order"],
}
"""Columns that every study writes. Older or foreign files may lack them: a missing condition was at
its default.
"""
_OF_EPISODES = (
    _BY_WRITER
    | {
        "detector": as_optional(TEXT),
        "keyframe_s": as_optional(SUM),
        "braked_before_view": as_optional(FLAG),
        "closing_speed_mps": as_optional(SUM),
        "hit_kind": as_optional(TEXT),
        "hit_at_front": as_optional(FLAG),
        "world_hash": as_optional(TEXT),
    }
    | {name: CONDITION_COLUMNS[name] for name in COLUMNS_WHERE_CHANGED}
)
"""Columns of every study of the closed loop."""
# A required column may be empty in a row if its event did not happen: a detection, a view of the
# actor, a collision.
_EPISODES = Schema(
    {name: CONDITION_COLUMNS.get(name, TEXT) for name in PLAIN_FIELDS if name not in _OF_EPISODES}
    | {
        "budget": SHARE,
        "seed": SEED,
        "detection_distance_m": as_optional(SUM),
        "undetected_to_m": as_optional(SUM),
        "braked": FLAG,
        "min_distance_m": as_optional(SUM),
        "clearance_m": as_optional(MEASURE),
        "collision": FLAG,
        "impact_speed_mps": as_optional(SUM),
        "rays_fired": COUNT,
    },
    _OF_EPISODES,
)
_COUNTS = Column("lists of whole numbers", least=0)
_ANY_PLAY = {
    name: CONDITION_COLUMNS.get(name, TEXT)
    for name in (*PLAY_FIELDS, "film_hash")
    if name not in _BY_WRITER
} | {
    "budget": SHARE,
    "keyframes": COUNT,
    "floor_seed": COUNT,
    "ttfds": _COUNTS,
}
"""Columns of every row of the open loop."""
_OF_SOME_PLAYS = {
    "recording": as_optional(TEXT),
    "camera_detections": as_optional(TEXT),
    "sweeps": as_optional(COUNT),
    "camera_times": as_optional(TEXT),
    "empty_boxes": as_optional(FLAG),
    "points": as_optional(TEXT),
    "reference": as_optional(TEXT),
    "topics": as_optional(TEXT),
    "presence": as_optional(TEXT),
} | {name: CONDITION_COLUMNS[name] for name in COLUMNS_WHERE_CHANGED if name in OF_BOTH_LOOPS}
_PLAYS = Schema(
    _ANY_PLAY
    | dict.fromkeys(SUMS, TALLY)
    | {
        "tracks": SUM,
        "explained": SUM,
        # Nothing for the reference, which differs from itself in nothing, and for the full scan.
        "differing_keyframes": as_optional(COUNT),
        "differing_cells": as_optional(COUNT),
    },
    _BY_WRITER | _OF_SOME_PLAYS | {"emerging": as_optional(COUNT), "released": as_optional(SUM)},
    SUMS,
    {"sighted": "events", "found": "frames", "events": "frames"},
)
_MECHANISM = Schema(
    _ANY_PLAY
    | dict.fromkeys(ACCOUNT_COLUMNS, _COUNTS)
    | {"driver": TEXT, "misses": Column("lists of texts")}
    # The full scan is not compared on the shared belief; the driver's row describes that belief.
    | dict.fromkeys((*DIFFERING, *BELIEF_SUMS), as_optional(COUNT))
    | dict.fromkeys((RECEIVED, *BELIEF_MARKS), as_optional(_COUNTS)),
    _BY_WRITER | _OF_SOME_PLAYS,
)
_VEHICLE = Schema(
    {**_EPISODES.needed, "keyframes": COUNT}
    | dict.fromkeys(VEHICLE_LISTS, _COUNTS)
    | dict.fromkeys(VEHICLE_COUNTS, COUNT)
    | dict.fromkeys(VEHICLE_MEASURES, as_optional(SUM)),
    {
        **_EPISODES.further,
        "progress": as_optional(SUM),
        "needless_braking": as_optional(COUNT),
    },
    parts={
        "turned_boxes": "boxes",
        "dark_keyframes": "keyframes",
        "dark_alike": "dark_keyframes",
        "standing_keyframes": "keyframes",
        "forecasts_in_eq4": "forecasts",
        "forecasts_in_margin": "forecasts",
    },
)
EPISODES = ResultsFormat(
    task="episode",
    play_batch=play_episodes,
    most=MOST_TOGETHER,
    kept_rows=with_added_columns,
    file="episodes.parquet",
    schema=_EPISODES,
    listed=listed_episodes,
)
VEHICLE = ResultsFormat(
    task="watched episode",
    play_batch=play_vehicle,
    most=1,
    kept_rows=with_added_columns,
    file="vehicle.parquet",
    schema=_VEHICLE,
    listed=listed_episodes,
)
PLAYS = ResultsFormat(
    task="play",
    play_batch=play_scene,
    most=None,
    # The events have a file of their own, one row per event and play.
    kept_rows=lambda rows: [
        {name: value for name, value in row.items() if name != "sightings"}
        for row in with_tags(rows)
    ],
    file="plays.parquet",
    schema=_PLAYS,
    listed=listed_plays,
    further_files=lambda rows: {"events.parquet": event_columns(rows)},
)
MECHANISM = ResultsFormat(
    task="accounted play",
    play_batch=play_mechanism,
    most=None,
    kept_rows=with_tags,
    file="mechanism.parquet",
    schema=_MECHANISM,
    listed=listed_plays,
)
RESULTS_FORMATS = (EPISODES, VEHICLE, PLAYS, MECHANISM)
UNREAD = frozenset(
    {"keyframes", "wall_s", "peak_rss_mb", "regret_m", "censored", *DECISION_MS}
    | {field.name for field in fields(DriveOutcome)}
)
"""Columns that this version writes but no report reads."""
_PARAMETERS = frozenset(
    {
        *PLAIN_FIELDS,
        *PLAY_FIELDS,
        "scene",
        "sensor",
        "sensor_hash",
        "sensor_setup",
        "detector",
        "keyframe_s",
        *READ_WITH,
        "presence",
        "driver",
    }
)


def results_format_in(folder: Path) -> ResultsFormat:
    """Return the format of the results in a folder, by default that of episodes."""
    return next((kind for kind in RESULTS_FORMATS if (folder / kind.file).is_file()), EPISODES)


def is_parameter(name: str) -> bool:
    """Return True if a column of rows holds a task's parameter."""
    return name in _PARAMETERS or name.startswith(PARAMETERS)
