"""Checks of the rows of one or several folders: each task once and equal, one film and one world
for all policies, every column known.
"""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import care_sim
from care_sim.base.errors import InvalidInput, printable
from care_sim.core.conditions import DEFAULTS
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.study.results_formats import UNREAD, is_parameter
from care_sim.study.rows.reading import setting_of
from care_sim.study.rows.schema import Schema
from care_sim.study.run_config import Row
from care_sim.study.scene_play import DECISION_MS

USUAL = DEFAULTS | {"presence": ANNOTATED}
"""Defaults of parameters that rows of older versions lack."""
Task = frozenset[tuple[str, Any]]
"""The parameters of a task that are not the default, by name."""
_UNREAD = ("drawn.", "expected/")
"""First letters of columns that only other commands read."""
_LABEL_NAMES = ("scene", "scenario", "policy", "budget")
_LABEL_SEEDS = ("seed", "floor_seed")
_MAY_DIFFER = {
    # Columns of the code, the machine and the speed.
    *("version", "digest", "wall_s", "peak_rss_mb", *DECISION_MS),
    # Columns computed from the other rows of the folder.
    *("tags", "regret_m", "censored", "differing_keyframes", "differing_cells"),
}
"""Columns that may differ between rows of one outcome."""
_MOST_NAMED = 5
"""Most unknown columns that a line names."""


def asked_with(row: Row) -> Row:
    """Return the parameters of a row that differ from the defaults."""
    asked = {
        name: value
        for name in _parameters(tuple(row))
        if (value := row[name]) is not None and value != USUAL.get(name)
    }
    # A row holds the digest of a file of camera detections. Only its presence counts, so that a
    # command may replace its own rows after the file has changed.
    if "camera_detections" in asked:
        asked["camera_detections"] = True
    return asked


@lru_cache
def _parameters(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parameters among columns. Thousands of rows share the same `names`."""
    return tuple(filter(is_parameter, names))


def identity(row: Row) -> Task:
    """Return a key that is equal for rows of one task, for any code that played it."""
    return frozenset(asked_with(row).items())


def row_label(row: Row) -> str:
    """A short name for people: world, policy, budget, and seeds that are not 0."""
    main = [str(row[name]) for name in _LABEL_NAMES if row.get(name) is not None]
    return " ".join([*main, *(f"{name} {row[name]}" for name in _LABEL_SEEDS if row.get(name))])


class RowChecks:
    """The tasks and films of the folders so far."""

    def __init__(self) -> None:
        self.twice = 0
        self.shared: set[frozenset[Path]] = set()
        """Pairs of folders that hold one task, or one film."""
        self._rows: dict[Task, tuple[Path, Row]] = {}
        self._films: dict[object, tuple[Path, str]] = {}

    def is_new(self, row: Row, folder: Path) -> bool:
        """Return True for the first row of a task. Raises if an earlier row of the task differs."""
        if row.get("film_hash"):
            self._check_film(row, folder)
        before, other = self._rows.setdefault(identity(row), (folder, row))
        if other is row:
            return True
        # A column in only one row was added between two versions. NaN is not equal to itself.
        unlike = [
            name
            for name in other
            if name in row and name not in _MAY_DIFFER
            if (a := other[name]) != (b := row[name]) and not (a != a and b != b)
        ]
        if unlike:
            raise InvalidInput(
                f"{row_label(row)} came out differently in {before} and {folder} ({unlike[0]}: "
                f"{other[unlike[0]]}, {row[unlike[0]]}): the code or a file has changed between "
                "them; play one of them again"
            )
        self.twice += 1
        self.shared.add(frozenset((before, folder)))
        return False

    def unknown(self, columns: Sequence[str], schema: Schema) -> list[str]:
        """Return a line if tables leave out unknown `columns`."""
        known = {*schema.known(columns), *UNREAD}
        names = [name for name in columns if name not in known and not name.startswith(_UNREAD)]
        if not names:
            return []
        versions = sorted({row.get("version") or "unknown" for _, row in self._rows.values()})
        rest = [f"{len(names) - _MOST_NAMED} more"] if len(names) > _MOST_NAMED else []
        return [
            f"rows of care-sim {', '.join(versions)} have columns that this version, "
            f"{care_sim.__version__}, does not know: "
            f"{', '.join([*map(printable, names[:_MOST_NAMED]), *rest])}; rows that differ in them "
            "are counted together"
        ]

    def _check_film(self, row: Row, folder: Path) -> None:
        # The return model is a part of the film, and a condition.
        place = setting_of(row), row["scene"]
        before, film = self._films.setdefault(place, (folder, row["film_hash"]))
        if film != row["film_hash"]:
            raise InvalidInput(
                f"{row['scene']} has another film in {folder} than in {before}: their plays cannot "
                "be compared; play one of them again"
            )
        self.shared.add(frozenset((before, folder)))


def check_worlds(rows: Iterable[Row]) -> None:
    """Raise InvalidInput where two rows of one scenario and seed met different worlds. Rows without
    a `world_hash` are not checked: the built-in scenarios draw everything from the seed.
    """
    first: dict[object, Row] = {}
    for row in rows:
        if not row.get("world_hash"):
            continue
        given = sorted((name, repr(row[name])) for name in row if name.startswith("scenario."))
        other = first.setdefault((row["scenario"], row["seed"], *given), row)
        if other["world_hash"] != row["world_hash"]:
            raise InvalidInput(
                f"scenario {row['scenario']} builds one world for {other['policy']} and another "
                f"for {row['policy']} of the seed {row['seed']}: it draws outside its rng, or its "
                "code has changed; draw everything from the rng that build receives"
            )
