"""The JSON files of a nuScenes database: rows of plain data, each field of its kind. The recordings
and annotations of every sample are stored in a file that all processes share (SQLite).
"""

import fcntl
import hashlib
import json
import os
import sqlite3
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from care_sim.base.digests import file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.base.files import cache_folder, json_content, listed_values
from care_sim.core.arrays import Floats

JsonRow = dict[str, Any]

LARGEST_TABLE = 2**33
"""Bytes of a file: several times the largest table of all of nuScenes (2.6 million recordings of
half a kilobyte).
"""
FIELDS: dict[str, dict[str, type]] = {
    "scene": {"name": str, "first_sample_token": str, "last_sample_token": str},
    "sample": {"timestamp": int, "next": str},
    "sample_data": {
        "sample_token": str,
        "ego_pose_token": str,
        "calibrated_sensor_token": str,
        "filename": str,
        "is_key_frame": bool,
        "timestamp": int,
    },
    "calibrated_sensor": {
        "sensor_token": str,
        "translation": list,
        "rotation": list,
        "camera_intrinsic": list,
    },
    "sensor": {"channel": str},
    "ego_pose": {"translation": list, "rotation": list},
    "sample_annotation": {
        "sample_token": str,
        "instance_token": str,
        "visibility_token": str,
        "translation": list,
        "size": list,
        "rotation": list,
        "num_lidar_pts": int,
        "num_radar_pts": int,
    },
    "instance": {"category_token": str},
    "category": {"name": str},
    "visibility": {"level": str},
}
"""Fields read from each table, beside its token."""
KIND_WORDS = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
"""Names of the kinds of values in messages."""


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises InvalidInput for a file that is missing, truncated or larger than `LARGEST_TABLE`.
    """
    with _readable(path):
        return json_content(path, LARGEST_TABLE)


def table_rows(path: Path, is_needed: Callable[[JsonRow], bool] | None = None) -> Iterator[JsonRow]:
    """The rows of a table one by one, those that are needed, with their token and `FIELDS` alone.

    Raises InvalidInput as `read_json` does, for what is no list, and for the first needed row that
    lacks a field or has another kind of value in it.
    """
    kinds = {"token": str, **FIELDS[path.stem]}
    wanted = [*kinds.values()]
    for number, row in enumerate(_values(path)):
        if not isinstance(row, dict):
            raise InvalidInput(f"{path}: row {number} must be a map of fields")
        if is_needed is not None and not is_needed(row):
            continue
        taken = {name: row.get(name) for name in kinds}
        # Not isinstance: to Python true is an int.
        if [*map(type, taken.values())] != wanted:
            raise InvalidInput(f"{path}: {_describe_fault(row, number, kinds)}")
        yield taken


def check_tokens(path: Path, tokens: list[str]) -> None:
    """Raise InvalidInput for a token that stands twice in a table."""
    if len(set(tokens)) < len(tokens):
        (token, count), *_ = Counter(tokens).most_common(1)
        raise InvalidInput(f"{path}: {count} rows with the token {token!r}")


def finite_numbers(value: object, *shape: int) -> Floats | None:
    """A JSON value as an array of `shape`, None for one that is not so many finite numbers."""
    try:
        values = np.array(value)
    except ValueError:
        return None
    if values.shape != shape or values.dtype.kind not in "if" or not np.isfinite(values).all():
        return None
    return values.astype(float)


def _values(path: Path) -> Iterator[Any]:
    with _readable(path):
        yield from listed_values(path, LARGEST_TABLE)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def _describe_fault(row: JsonRow, number: int, kinds: dict[str, type]) -> str:
    which = f"row {row.get('token') or number}"
    name = next(name for name, kind in kinds.items() if type(row.get(name)) is not kind)
    return (
        f"{which}: {name} must be {KIND_WORDS[kinds[name]]}, got {row[name]!r}"
        if name in row
        else f"{which} lacks {name!r}"
    )


FORM = "3"
"""Raised whenever the same files make another store."""
_TABLES = ("sample", "sample_data", "ego_pose", "calibrated_sensor", "sensor", "sample_annotation")
"""The tables that a store is made of."""
_SCHEMA = """
CREATE TABLE sample (token);
CREATE TABLE sample_data (token, sample, filename, is_key, pose, content);
CREATE TABLE sample_annotation (token, sample, content);
CREATE TABLE ego_pose (token, content);
"""
_UNUSED_S = 7 * 24 * 3600.0
TablePath = Callable[[str], Path]
"""The file of a table by its name."""


def _remove_unused(folder: Path, database: str) -> None:
    """Remove stores of other versions of a database that nobody has read for a week: another
    machine that shares the folder may read them now.
    """
    for old in folder.glob(f"{database}-*"):
        if time.time() - old.stat().st_atime > _UNUSED_S:
            old.unlink(missing_ok=True)


class SampleStore:
    """The rows of a database by sample.

    The tables `sample_data`, `ego_pose` and `sample_annotation` of all of nuScenes hold six million
    rows in 2.6 GB of text, most of them unneeded. They are read once, row by row. The store keeps a
    sample's boxes, with a flag `has_points` instead of their number. It keeps recordings of
    keyframes, and all of the calibrated sensors `lidars`, together about one in four. It keeps the
    car's poses at these recordings, for cameras only those of `cameras`.

    The store is in the user's cache folder (`XDG_CACHE_HOME`, else `~/.cache`). It is made anew
    when a table has changed, and by every process if it cannot be stored. If several processes need
    it at once, the first makes it. Raises InvalidInput as `table_rows` does, for a repeated token,
    and for a box of a missing sample.
    """

    def __init__(
        self,
        path: TablePath,
        samples: Sequence[str],
        lidars: Sequence[str],
        cameras: Sequence[str],
    ):
        self._path = path
        self._samples = samples
        self._lidars = frozenset(lidars)
        self._posed = frozenset([*lidars, *cameras])
        # Tells the tables as they are now from the same at another time.
        files = [path(table) for table in _TABLES]
        stamps = [file_stamp(file)[1:] for file in files if file.is_file()]
        folder = os.fsencode(files[0].parent.resolve())
        parts = (hashlib.sha256(one).hexdigest()[:16] for one in (folder, repr(stamps).encode()))
        self._key = (FORM, *parts)
        self._file = self._kept(*self._key)

    def boxes(self, sample: str) -> list[JsonRow]:
        """The boxes of a sample, in the order of `sample_annotation`."""
        return self._contents("sample_annotation", "sample", sample)

    def recordings(self, sample: str) -> list[JsonRow]:
        """The recordings of a sample, in the order of `sample_data`."""
        return self._contents("sample_data", "sample", sample)

    def pose(self, token: str) -> JsonRow | None:
        """The pose of the car with a token, None where there is none."""
        return next(iter(self._contents("ego_pose", "token", token)), None)

    def pictures(self) -> frozenset[str]:
        """The tokens and the file names of all recordings of keyframes."""
        rows = self._asked("SELECT token, filename FROM sample_data WHERE is_key")
        return frozenset(name for row in rows for name in row)

    def _contents(self, table: str, column: str, value: str) -> list[JsonRow]:
        query = f"SELECT content FROM {table} WHERE {column} = ? ORDER BY rowid"
        return [json.loads(content) for (content,) in self._asked(query, value)]

    def _asked(self, query: str, *values: str) -> list[tuple[Any, ...]]:
        # Opened each time: a connection must not be taken into another process or thread.
        try:
            return self._read(query, *values)
        except sqlite3.DatabaseError as error:
            # A file that cannot be opened may have been deleted; a file that opens and cannot be
            # read is damaged. It is made again, once.
            if not isinstance(error, sqlite3.OperationalError):
                self._file.unlink(missing_ok=True)
            self._file = self._kept(*self._key)
        try:
            return self._read(query, *values)
        except sqlite3.DatabaseError as error:
            raise InvalidInput(f"{self._file}: cannot be read ({error})") from error

    def _read(self, query: str, *values: str) -> list[tuple[Any, ...]]:
        place = f"{self._file.as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(place, uri=True)) as store:
            return store.execute(query, values).fetchall()

    def _kept(self, form: str, database: str, stamp: str) -> Path:
        """The file of the store, made if it is not there."""
        name = f"{database}-{form}-{stamp}.sqlite"
        folder = cache_folder("nuscenes")
        # Nothing may be written there, or the disk is full.
        with suppress(OSError, sqlite3.OperationalError):
            if (folder / name).exists():
                return folder / name
            (folder / database).mkdir(parents=True, exist_ok=True)
            # Each database has a lock of its own. Without locks two makers have two files.
            part = folder / f"{name}.{os.getpid()}.part"
            with _alone(folder / database):
                if not (folder / name).exists():
                    _remove_unused(folder, database)
                    try:
                        self._make(part)
                        os.replace(part, folder / name)
                    finally:
                        part.unlink(missing_ok=True)
            return folder / name
        self._temporary = TemporaryDirectory()
        try:
            self._make(Path(self._temporary.name) / name)
        except sqlite3.OperationalError as error:
            raise InvalidInput(
                f"{folder} and {self._temporary.name}: no room for the tables ({error}); all of "
                "nuScenes needs about a gigabyte"
            ) from error
        return Path(self._temporary.name) / name

    def _make(self, file: Path) -> None:
        file.unlink(missing_ok=True)
        with closing(sqlite3.connect(file)) as store, store:
            store.executescript(_SCHEMA)
            self._fill(store, "sample", ((token,) for token in self._samples))
            self._fill(store, "sample_data", self._recorded())
            self._fill(store, "sample_annotation", self._annotated())
            used = "SELECT DISTINCT pose FROM sample_data WHERE pose IS NOT NULL"
            self._fill(store, "ego_pose", self._poses({token for (token,) in store.execute(used)}))
            lost = "SELECT sample FROM sample_annotation WHERE sample NOT IN sample LIMIT 1"
            for (sample,) in store.execute(lost):
                # A box of a sample that there is not would be missed in silence.
                raise InvalidInput(f"{self._path('sample')}: no row with the token {sample!r}")
            for table, column in (("sample_data", "sample"), ("sample_annotation", "sample")):
                store.execute(f"CREATE INDEX {table}_{column} ON {table} ({column})")
            store.execute("CREATE INDEX ego_pose_token ON ego_pose (token)")

    def _fill(
        self, store: sqlite3.Connection, table: str, rows: Iterable[tuple[object, ...]]
    ) -> None:
        width = len(store.execute(f"SELECT * FROM {table}").description)
        try:
            store.executemany(f"INSERT INTO {table} VALUES ({','.join('?' * width)})", rows)
        except UnicodeEncodeError as error:
            raise InvalidInput(f"{self._path(table)}: half a character ({error})") from error
        twice = f"SELECT token, COUNT(*) FROM {table} GROUP BY token HAVING COUNT(*) > 1 LIMIT 1"
        for token, count in store.execute(twice):
            raise InvalidInput(f"{self._path(table)}: {count} rows with the token {token!r}")

    def _recorded(self) -> Iterator[tuple[object, ...]]:
        def is_needed(row: JsonRow) -> bool:
            # A row that lacks the field stays, to be refused.
            is_between = row.get("is_key_frame") is False
            return not is_between or str(row.get("calibrated_sensor_token")) in self._lidars

        for row in table_rows(self._path("sample_data"), is_needed):
            # No other pose is asked for.
            is_posed = row["calibrated_sensor_token"] in self._posed
            pose = row["ego_pose_token"] if is_posed else None
            key = row["token"], row["sample_token"], row["filename"], row["is_key_frame"]
            yield *key, pose, json.dumps(row)

    def _annotated(self) -> Iterator[tuple[object, ...]]:
        for row in table_rows(self._path("sample_annotation")):
            has_points = row.pop("num_lidar_pts") + row.pop("num_radar_pts") > 0
            content = json.dumps(row | {"has_points": has_points})
            yield row["token"], row["sample_token"], content

    def _poses(self, tokens: set[str]) -> Iterator[tuple[object, ...]]:
        """Poses are recorded for every sweep and picture; those of the `tokens` alone are kept."""
        # A row that lacks its token stays, to be refused.
        path = self._path("ego_pose")
        for row in table_rows(path, lambda row: "token" not in row or str(row["token"]) in tokens):
            yield row["token"], json.dumps(row)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Other processes that ask for the same wait meanwhile."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
