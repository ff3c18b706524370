"""The rows of a study of either loop by cell: a setting, a policy with its parameters, a budget."""

from collections.abc import Iterable, Sequence
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import RETURN_SETTINGS
from care_sim.evaluation.scene_contrasts import Tallies, averaged
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.measures import Measure, Recall, Units, tally_of
from care_sim.reports.formatting import marked, tag_notes
from care_sim.study.rows.reading import (
    READ_WITH,
    Key,
    Setting,
    grouped,
    policy_of,
    setting_of,
    tags_of_row,
)
from care_sim.study.run_config import FULL, Row


class Frame:
    """The rows of a study by cell; a cell that was not played has none.

    Raises InvalidInput where the plays of a scene are of two films, or one does not tell the TTFD
    of its events.
    """

    def __init__(self, rows: Sequence[Row]):
        _check_films(rows)
        self.rows = rows
        self.groups = grouped(rows)
        # Studies also look a policy up by its name alone: parameters change no tag.
        self.tags = {
            name: tags_of_row(row) for row in rows for name in (policy_of(row), row["policy"])
        }
        self.scenes: dict[Setting, dict[str, Row]] = {}
        """One row of every scene of a setting; none in the closed loop."""
        for row in (row for row in rows if "scene" in row):
            self.scenes.setdefault(setting_of(row), {})[row["scene"]] = row
        self._tallies: dict[tuple[Key, str], Tallies] = {}

    @property
    def policies(self) -> list[str]:
        """Their names without parameters, in the order of their first rows."""
        return list(dict.fromkeys(row["policy"] for row in self.rows))

    def of(self, key: Key) -> Sequence[Row]:
        """The rows of a cell. The full scan runs once for all settings and budgets that it does not
        feel, and is found from each of them.
        """
        setting, policy, _ = key
        if policy != FULL:
            return self.groups.get(key, ())
        if own := self.groups.get((setting, FULL, 1.0)):
            return own
        # Over scenes that the setting lacks it would be no ceiling of it.
        scenes = self.scenes.get(setting, {})
        borrowed = self.groups.get((setting.for_full(), FULL, 1.0), ())
        return [row for row in borrowed if "scene" not in row or row["scene"] in scenes]

    def tallies(self, key: Key, within: str = "") -> Tallies:
        """The mean tally over floor seeds of every scene that was played with all of them."""
        # Cached: tables share tallies.
        if (key, within) not in self._tallies:
            self._tallies[key, within] = averaged(by_floor_seed(self.of(key), within))
        return self._tallies[key, within]

    def units(self, measure: Measure | Recall, key: Key) -> Units:
        """Return the measurements of a cell, by seed or by scene."""
        if isinstance(measure, Recall):
            return self.tallies(key, measure.within)
        return measure.units(self.of(key))

    def contrast(self, measure: Measure | Recall, ours: Key, theirs: Key) -> Contrast | None:
        """Return one cell minus another, paired by unit; None without shared units."""
        return contrast(measure, self.units(measure, ours), self.units(measure, theirs))

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags.get(policy, ()))

    def notes(self, policies: Iterable[str]) -> tuple[str, ...]:
        """Return the notes that explain the marks of these policies."""
        return tag_notes(self.tags.get(policy, ()) for policy in policies)


def by_floor_seed(rows: Iterable[Row], within: str = "") -> list[Tallies]:
    """The tallies of every floor seed by scene."""
    seeds: dict[int, dict[str, Any]] = {}
    for row in rows:
        seeds.setdefault(row["floor_seed"], {})[row["scene"]] = tally_of(row, within)
    return [*seeds.values()]


def _check_films(rows: Sequence[Row]) -> None:
    """The data of a source may have changed between two runs into one folder."""
    films: dict[tuple[object, ...], str] = {}
    # How a recording is read, and what becomes of pulses, makes another film of the scene.
    made_with = (*READ_WITH, *RETURN_SETTINGS)
    for row in (row for row in rows if "source" in row):
        scene = (row["source"], row["scene"], *(row.get(name) for name in made_with))
        if len(row["ttfds"]) != row["events"]:
            raise InvalidInput(
                f"a play of scene {row['scene']} has {len(row['ttfds'])} TTFD of {row['events']:g} "
                "events"
            )
        if films.setdefault(scene, row["film_hash"]) != row["film_hash"]:
            raise InvalidInput(
                f"the plays of scene {row['scene']} are of two films: its data changed between "
                "runs; give another --out"
            )
