"""The episodes of a page as it lists them, setting by setting: one line per configuration, one
entry per seed, of the open loop per scene.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from care_sim.base.errors import counted, percent
from care_sim.reports.formatting import marked
from care_sim.reports.page.episodes import Episode
from care_sim.reports.page.played_rows import in_open_loop
from care_sim.reports.page.story import packed
from care_sim.study.rows.reading import (
    Setting,
    policy_of,
    setting_of,
    stops_for_nothing,
    tags_of_row,
)
from care_sim.study.run_config import Row


class EpisodeEntry(NamedTuple):
    """Entry of an episode in the list; `number` is that of its replay in the page, None without
    one.
    """

    text: str
    about: str
    collision: bool
    differs: bool
    number: int | None


class Group(NamedTuple):
    """The configurations of a setting: by policy and budget an entry for each of the `worlds`,
    seeds or scenes, None where it was not played. `watchable` counts the episodes to watch.
    """

    label: str
    worlds: list[str]
    configurations: dict[tuple[str, str], list[EpisodeEntry | None]]
    watchable: int


def episode_groups(rows: Sequence[Row], episodes: Sequence[Episode]) -> list[Group]:
    """All rows by setting, of the open loop those in scenes that can be watched; `episodes` are
    those of them that were played again, in the order of `replay_data`.
    """
    # A configuration is unique in the rows of a study.
    held = {_place(each.row): (number, each) for number, each in enumerate(_watchable(episodes))}
    # A study of the open loop has up to 150 scenes, of which few are played again.
    shown = {_column(episode.row) for _, episode in held.values()}
    by_setting: dict[Setting, list[Row]] = {}
    for row in rows:
        if not in_open_loop(row) or _column(row) in shown:
            by_setting.setdefault(setting_of(row), []).append(row)
    return [_group(setting, own, held) for setting, own in by_setting.items()]


def replay_data(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Return the data of `play.js`: every replay, and the standing bodies that several share."""
    # Policies meet the same world, whose standing bodies are then written once.
    standing: dict[str, Any] = {}
    worlds: dict[Any, int] = {}
    played = []
    for episode in _watchable(episodes):
        assert episode.replay is not None
        row, key = episode.row, repr(episode.replay.bodies)
        standing.setdefault(key, episode.replay.bodies)
        played.append(
            {
                "policy": f"{_policy(row)} {percent(row['budget'])}",
                "setting": setting_of(row).label,
                "where": _where(row),
                "world": worlds.setdefault(_world(row), len(worlds)),
                "bodies": [*standing].index(key),
                "differences": episode.differences,
                "story": packed(episode.replay.story),
            }
        )
    return {"bodies": [*standing.values()], "episodes": played}


def _watchable(episodes: Sequence[Episode]) -> list[Episode]:
    return [episode for episode in episodes if episode.replay]


def _group(setting: Setting, rows: Sequence[Row], held: dict[Any, tuple[int, Episode]]) -> Group:
    worlds = {_column(row): _where(row) for row in rows}
    columns = sorted(worlds)
    found = {
        (_policy(row), percent(row["budget"]), _column(row)): _entry(
            row, *held.get(_place(row), (None, None))
        )
        for row in rows
    }
    # A world that this configuration was not played in leaves its place empty.
    lines = {key[:2]: [found.get((*key[:2], each)) for each in columns] for key in found}
    watchable = sum(_place(row) in held for row in rows)
    return Group(setting.label, [worlds[each] for each in columns], lines, watchable)


def _entry(row: Row, number: int | None, episode: Episode | None) -> EpisodeEntry:
    differs = bool(episode and episode.differences)
    if in_open_loop(row):
        found, events = int(row["sighted"]), int(row["events"])
        about = f"{found} of {counted(events, 'first sighting')} found at once"
        return EpisodeEntry(f"{found}/{events}", about, False, differs, number)
    distance = row["detection_distance_m"]
    said = [
        "never detected" if distance is None else f"first detected at {distance:.1f} m",
        ("braked" if row["braked"] else "did not brake")
        + (" for nothing before the actor was in view" if stops_for_nothing(row) else ""),
        *(["collided"] if row["collision"] else []),
    ]
    text = "never" if distance is None else f"{distance:.1f}"
    return EpisodeEntry(text, ", ".join(said), row["collision"], differs, number)


def _policy(row: Row) -> str:
    return marked(policy_of(row), tags_of_row(row))


def _column(row: Row) -> Any:
    """Return the key that orders worlds: the seed, of the open loop the scene and the floor."""
    return (row["scene"], row["floor_seed"]) if in_open_loop(row) else row["seed"]


def _where(row: Row) -> str:
    if not in_open_loop(row):
        return f"seed {row['seed']}"
    floor = f", floor {row['floor_seed']}" if row["floor_seed"] else ""
    return f"{row['scene']}{floor}"


def _place(row: Row) -> tuple[Any, ...]:
    return setting_of(row), policy_of(row), row["budget"], _column(row)


def _world(row: Row) -> tuple[Any, ...]:
    """Return the key that two episodes share which can be watched side by side: scenario, physics,
    seed, or the scene.
    """
    if in_open_loop(row):
        return row["source"], row["scene"]
    # None is a parameter that was not given; 0 is one that was.
    physics = sorted(
        (name, repr(value))
        for name, value in row.items()
        if name.startswith("scenario.") and value is not None
    )
    return row["scenario"], tuple(physics), row["seed"]
