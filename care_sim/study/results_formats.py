"""The two kinds of results: episodes of the closed loop and plays of the open loop, how each is
played and how it is kept.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_sim.loops.records import Outcome
from care_sim.study.episode_config import PLAIN_FIELDS, listed_episodes
from care_sim.study.episode_play import play_episodes
from care_sim.study.play_config import PLAY_FIELDS, listed_plays
from care_sim.study.rows.reading import with_added_columns, with_tags
from care_sim.study.rows.schema import (
    CONDITION_COLUMNS,
    COUNT,
    FLAG,
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
from care_sim.study.scene_play import SUMS, event_columns, play_scene, without_events


@dataclass(frozen=True)
class ResultsFormat:
    """How one kind of results is played and kept.

    `unit` is what its tasks are called. `play_batch` plays a batch. `finish` makes rows side by
    side into those that are kept. `file` holds them, in columns of the `schema`. `listed` gives
    configurations as plain data. `aside` gives further files, as columns by file name, made of the
    rows as they were played.
    """

    unit: str
    play_batch: PlayBatch
    finish: Callable[[Sequence[Row]], list[Row]]
    file: str
    schema: Schema
    listed: Callable[[Any], dict[str, Any]]
    aside: Callable[[Sequence[Row]], dict[str, dict[str, Any]]] = lambda _rows: {}


# Added when a study is written. Older files and those of others may lack them.
_WRITER_COLUMNS = dict.fromkeys(("version", "digest", "episode_hash", "tags"), as_optional(TEXT))
_EPISODES = Schema(
    {name: CONDITION_COLUMNS.get(name, TEXT) for name in PLAIN_FIELDS}
    | {"budget": SHARE, "seed": SEED, "braked": FLAG, "collision": FLAG, "rays_fired": COUNT}
    | {
        name: as_optional(SUM)
        # Every outcome that may be None: distances and speeds of what did not happen.
        for name, kind in Outcome.__annotations__.items()
        if kind == float | None
    },
    _WRITER_COLUMNS,
)
_PLAYS = Schema(
    {name: CONDITION_COLUMNS.get(name, TEXT) for name in (*PLAY_FIELDS, "film_hash")}
    | {
        "budget": SHARE,
        "keyframes": COUNT,
        "floor_seed": COUNT,
        "ttfds": Column("lists of whole numbers", least=0),
    }
    | dict.fromkeys(SUMS, TALLY)
    | dict.fromkeys(("tracks", "explained"), SUM)
    # Nothing for the reference, which differs from itself in nothing, and for the full scan.
    | dict.fromkeys(("differing_keyframes", "differing_cells"), as_optional(COUNT)),
    _WRITER_COLUMNS
    | dict.fromkeys(("recording", "camera_detections", "presence"), as_optional(TEXT))
    | {"emerging": as_optional(COUNT)},
    SUMS,
)
EPISODES = ResultsFormat(
    "episodes",
    play_episodes,
    with_added_columns,
    "episodes.parquet",
    _EPISODES,
    listed_episodes,
)
PLAYS = ResultsFormat(
    "plays",
    play_scene,
    # The events have a file of their own, one row per event and play.
    lambda rows: [without_events(row) for row in with_tags(rows)],
    "plays.parquet",
    _PLAYS,
    listed_plays,
    lambda rows: {"events.parquet": event_columns(rows)},
)
RESULTS_FORMATS = (EPISODES, PLAYS)
_PARAMETERS = frozenset({*PLAIN_FIELDS, *PLAY_FIELDS, "scene", "camera_detections", "presence"})


def results_format_in(folder: Path) -> ResultsFormat:
    """The format of the results in a folder; that of episodes where there are none."""
    return next((kind for kind in RESULTS_FORMATS if (folder / kind.file).is_file()), EPISODES)


def is_parameter(name: str) -> bool:
    """Whether a column of rows holds what a task was given."""
    return name in _PARAMETERS or name.startswith(PARAMETERS)
