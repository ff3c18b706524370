"""The episodes of a page as it lists them, setting by setting: one line per configuration, one
entry per seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from care_sim.base.errors import percent
from care_sim.reports.formatting import marked
from care_sim.reports.page.episodes import Episode
from care_sim.reports.page.replay import packed
from care_sim.study.rows.reading import policy_of, setting_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import Row


@dataclass(frozen=True)
class EpisodeEntry:
    """What an entry says of an episode; `number` is that of its replay in the page, None without
    one.
    """

    text: str
    about: str
    collision: bool
    differs: bool
    number: int | None


@dataclass(frozen=True)
class Configuration:
    """A policy at a budget, and its outcomes by seed; None for a seed that was not played."""

    policy: str
    budget: str
    outcomes: tuple[EpisodeEntry | None, ...]


@dataclass(frozen=True)
class Group:
    """The configurations of a setting, and their seeds; `watchable` counts the episodes that can be
    watched.
    """

    label: str
    seeds: tuple[int, ...]
    configurations: tuple[Configuration, ...]
    watchable: int


def episode_groups(rows: Sequence[Row], episodes: Sequence[Episode]) -> list[Group]:
    """All rows by setting; `episodes` are those of them that were played again, in the order of
    `replay_data`.
    """
    held = {
        # By its configuration, which is unique in the rows of a study.
        _place(episode.row): (number, episode)
        for number, episode in enumerate(_watchable(episodes))
    }
    by_setting: dict[Setting, list[Row]] = {}
    for row in rows:
        by_setting.setdefault(setting_of(row), []).append(row)
    return [_group(setting, own, held) for setting, own in by_setting.items()]


def replay_data(episodes: Sequence[Episode]) -> dict[str, Any]:
    """What `play.js` plays: every replay, and the standing bodies that several share."""
    standing: list[Any] = []
    numbers: dict[str, int] = {}
    worlds: dict[Any, int] = {}
    played = []
    for episode in _watchable(episodes):
        assert episode.replay is not None
        # Policies meet the same world, whose standing bodies are then written once.
        bodies = episode.replay.bodies
        number = numbers.setdefault(repr(bodies), len(numbers))
        if number == len(standing):
            standing.append(bodies)
        row = episode.row
        played.append(
            {
                "policy": f"{marked(policy_of(row), tags_of_row(row))} {percent(row['budget'])}",
                "setting": setting_of(row).label,
                "seed": row["seed"],
                "world": worlds.setdefault(_world(row), len(worlds)),
                "bodies": number,
                "differences": episode.differences,
                "story": packed(episode.replay.story),
            }
        )
    return {"bodies": standing, "episodes": played}


def _watchable(episodes: Sequence[Episode]) -> list[Episode]:
    return [episode for episode in episodes if episode.replay]


def _group(setting: Setting, rows: Sequence[Row], held: dict[Any, tuple[int, Episode]]) -> Group:
    seeds = sorted({row["seed"] for row in rows})
    lines: dict[tuple[str, str], dict[int, EpisodeEntry]] = {}
    for row in rows:
        key = marked(policy_of(row), tags_of_row(row)), percent(row["budget"])
        lines.setdefault(key, {})[row["seed"]] = _outcome(row, *held.get(_place(row), (None, None)))
    # A seed that this configuration was not played with leaves its place empty.
    configurations = [Configuration(*key, tuple(map(own.get, seeds))) for key, own in lines.items()]
    watchable = sum(_place(row) in held for row in rows)
    return Group(setting.label, tuple(seeds), tuple(configurations), watchable)


def _outcome(row: Row, number: int | None, episode: Episode | None) -> EpisodeEntry:
    distance = row["detection_distance_m"]
    said = [
        "never detected" if distance is None else f"first detected at {distance:.1f} m",
        "braked" if row["braked"] else "did not brake",
        *(["collided"] if row["collision"] else []),
    ]
    differs = bool(episode and episode.differences)
    text = "never" if distance is None else f"{distance:.1f}"
    return EpisodeEntry(text, ", ".join(said), row["collision"], differs, number)


def _place(row: Row) -> tuple[Any, ...]:
    return setting_of(row), policy_of(row), row["budget"], row["seed"]


def _world(row: Row) -> tuple[Any, ...]:
    """What two episodes share that can be watched side by side: scenario, physics, seed."""
    # None is a parameter that was not given; 0 is one that was.
    physics = sorted(
        (name, repr(value))
        for name, value in row.items()
        if name.startswith("scenario.") and value is not None
    )
    return row["scenario"], tuple(physics), row["seed"]
