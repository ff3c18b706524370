"""Checks of the rows of one folder, or of several that are merged: each task once, none missing,
every column known.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import lru_cache, reduce
from operator import or_
from pathlib import Path
from typing import Any

import care_sim
from care_sim.base.errors import InvalidInput, counted, printable
from care_sim.core.conditions import DEFAULTS
from care_sim.envs.closed_loop import KEYFRAME_S
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.perception.detectors import PROXY
from care_sim.study.results_formats import UNREAD, is_parameter
from care_sim.study.rows.parquet import with_tuples
from care_sim.study.rows.reading import setting_of
from care_sim.study.rows.schema import Schema
from care_sim.study.run_config import Row, flat

USUAL = DEFAULTS | {"presence": ANNOTATED}
"""Parameters of a row that does not name them: rows of older versions lack what was added since."""
Task = frozenset[tuple[str, Any]]
"""The parameters of a task that are not the default, by name."""
_LABEL_NAMES = ("scene", "scenario", "policy", "budget")
_LABEL_SEEDS = ("seed", "floor_seed")


def asked_with(row: Row) -> Row:
    """The parameters of a row that differ from the defaults."""
    asked = {
        name: value
        for name in _parameters(tuple(row))
        if (value := row[name]) is not None and value != USUAL.get(name)
    }
    # A row holds the digest of a file of camera detections. It counts only whether one was given,
    # so that the same command may replace its own rows after the file has changed.
    if "camera_detections" in asked:
        asked["camera_detections"] = True
    return asked


@lru_cache
def _parameters(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parameters among columns. Thousands of rows share the same `names`."""
    return tuple(filter(is_parameter, names))


def identity(row: Row) -> Task:
    """Equal for rows of one task, whatever code played it."""
    return frozenset(asked_with(row).items())


def row_label(row: Row) -> str:
    """A short name for people: world, policy, budget, and seeds that are not 0."""
    main = [str(row[name]) for name in _LABEL_NAMES if row.get(name) is not None]
    return " ".join([*main, *(f"{name} {row[name]}" for name in _LABEL_SEEDS if row.get(name))])


_OF_THE_PLAYING = ("version", "digest", "wall_s", "peak_rss_mb")
_OF_THE_FOLDER = ("tags", "regret_m", "censored", "differing_keyframes", "differing_cells")
"""Columns that rows of one outcome may have differently: who played it and how fast, and what was
worked out beside the other rows of its folder."""
_NOT_IN_ROWS = {("detector", PROXY), ("keyframe_s", KEYFRAME_S)}
"""Defaults that `config.json` lists, and rows may lack."""
_PARAMETERS = "_parameters"
_SEEDS = {"seeds": "seed", "floor_seeds": "floor_seed"}
_MOST_NAMED = 5
"""Unknown columns that a line names, at the most."""


class RowChecks:
    """The tasks and films of the folders so far."""

    def __init__(self) -> None:
        self.twice = 0
        self.shared: set[frozenset[Path]] = set()
        """Pairs of folders that hold one task, or one film."""
        self._rows: dict[Task, tuple[Path, Row]] = {}
        self._films: dict[object, tuple[Path, str]] = {}

    def is_new(self, row: Row, folder: Path) -> bool:
        """Whether no row before had its task. Raises where one came out differently."""
        if row.get("film_hash"):
            self._check_film(row, folder)
        before, other = self._rows.setdefault(identity(row), (folder, row))
        if other is row:
            return True
        unlike = [name for name in other if _differs(name, other, row)]
        if unlike:
            raise InvalidInput(
                f"{row_label(row)} came out differently in {before} and {folder} ({unlike[0]}: "
                f"{other[unlike[0]]}, {row[unlike[0]]}): the code or a file has changed between "
                "them; play one of them again"
            )
        self.twice += 1
        self.shared.add(frozenset((before, folder)))
        return False

    def doubts(self, columns: Sequence[str], schema: Schema, description: Any) -> list[str]:
        """What the tables of these rows leave out: `columns` that this version does not know, and
        tasks in `description`, the content of `config.json`, that have no row. A description
        without a list of tasks is not checked.
        """
        try:
            missing = [*self._missing([*_listed_parts(description)])]
        except (AttributeError, KeyError, TypeError, ValueError):
            missing = []
        known = {*schema.known(columns), *UNREAD}
        unknown = [name for name in columns if name not in known and not name.startswith("drawn.")]
        return [*self._unknown(unknown), *missing]

    def _unknown(self, names: Sequence[str]) -> Iterator[str]:
        if not names:
            return
        versions = sorted({row.get("version") or "unknown" for _, row in self._rows.values()})
        rest = [f"{len(names) - _MOST_NAMED} more"] if len(names) > _MOST_NAMED else []
        yield (
            f"rows of care-sim {', '.join(versions)} have columns that this version, "
            f"{care_sim.__version__}, does not know: "
            f"{', '.join([*map(printable, names[:_MOST_NAMED]), *rest])}; rows that differ in them "
            "are counted together"
        )

    def _missing(self, parts: Sequence[tuple[Sequence[Row], int]]) -> Iterator[str]:
        names = {name for listed, _ in parts for row in listed for name in row}
        asked = [Counter(_among(names, identity(row)) for row in listed) for listed, _ in parts]
        # A task of two merged folders has one row.
        missing = reduce(or_, asked) - Counter(_among(names, task) for task in self._rows)
        if missing.total() > sum(failed for _, failed in parts):
            first = row_label(dict(next(iter(missing))))
            yield f"{counted(missing.total(), 'row')} that config.json lists, the first {first}"

    def _check_film(self, row: Row, folder: Path) -> None:
        # How pulses return is a part of the film, and a condition.
        place = setting_of(row), row["scene"]
        before, film = self._films.setdefault(place, (folder, row["film_hash"]))
        if film != row["film_hash"]:
            raise InvalidInput(
                f"{row['scene']} has another film in {folder} than in {before}: their plays cannot "
                "be compared; play one of them again"
            )
        self.shared.add(frozenset((before, folder)))


def _differs(name: str, one: Row, other: Row) -> bool:
    own = (*_OF_THE_PLAYING, *_OF_THE_FOLDER)
    # A column that only one of them has was added between two versions.
    if name not in one or name not in other or name in own:
        return False
    both = one[name], other[name]
    # What is no number is equal to nothing, itself included.
    return both[0] != both[1] and not all(value != value for value in both)


def _among(names: Collection[str], task: Task) -> Task:
    return frozenset(pair for pair in task if pair[0] in names and pair not in _NOT_IN_ROWS)


def _listed_parts(description: Any) -> Iterator[tuple[list[Row], int]]:
    """The tasks that `config.json` lists, in columns of rows, and how many of them failed; of each
    folder that was merged.
    """
    if "merged" in description:
        for part in description["merged"].values():
            yield from _listed_parts(part)
        return
    configurations = [description["common"] | own for own in description["configurations"]]
    scenes = [{"scene": name} for name in description.get("scenes", [])] or [{}]
    plain = [row for given in configurations for row in _plain_rows(given)]
    yield [row | scene for row in plain for scene in scenes], len(description["failed"])


def _plain_rows(given: Row) -> list[Row]:
    """A row for every policy and seed of a configuration."""
    row: Row = {}
    for name, value in given.items():
        if name.endswith(_PARAMETERS):
            row |= flat(name.removesuffix(_PARAMETERS), value)
        # A set-up of a file is listed as a whole, and rows hold its hash.
        elif is_parameter(name) and name != "sensor":
            row[name] = value
    (plural,) = _SEEDS.keys() & given.keys()
    row = with_tuples(row)
    # Folders from before 0.3.0 list one policy at a time.
    return [
        row | {"policy": policy, _SEEDS[plural]: seed}
        for policy in given.get("policies", [given.get("policy")])
        for seed in given[plural]
    ]


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
