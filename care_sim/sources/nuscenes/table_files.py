"""The JSON files of a nuScenes database: rows of plain data, each field of its kind. Tables that
take long to make are kept in files that later processes map into their memory.
"""

import fcntl
import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from care_sim.base.digests import file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.base.files import check_output, json_content, listed_values, replacing
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
"""What is read of each table, beside its token."""
KIND_WORDS = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
"""What the kinds of values are called."""


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises InvalidInput for a file that is missing, truncated or larger than `LARGEST_TABLE`.
    """
    try:
        return json_content(path, LARGEST_TABLE)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


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
            raise InvalidInput(f"{path}: {_what_is_wrong(row, number, kinds)}")
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
    try:
        yield from listed_values(path, LARGEST_TABLE)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def _what_is_wrong(row: JsonRow, number: int, kinds: dict[str, type]) -> str:
    which = f"row {row.get('token') or number}"
    name = next(name for name, kind in kinds.items() if type(row.get(name)) is not kind)
    return (
        f"{which}: {name} must be {KIND_WORDS[kinds[name]]}, got {row[name]!r}"
        if name in row
        else f"{which} lacks {name!r}"
    )


ARROW = rb"ARROW1"
_STAMP = b"made of"


def cached_table(
    file: Path, form: str, sources: Iterable[Path], make: Callable[[], pa.Table]
) -> pa.Table:
    """The table that `make` makes of the files `sources`, in the given `form`.

    It is kept in `file`, or where that cannot be written in the user's cache folder
    (`XDG_CACHE_HOME`, else `~/.cache`). It is made anew when a source has changed, when the file is
    cut short, and when nothing can be kept. Of processes that want it at once the first makes it.
    """
    stamp = _stamp(form, sources)
    for place in _places(file):
        table = _kept(place, stamp, make)
        if table is not None:
            return table
    return make()


def _places(file: Path) -> Iterator[Path]:
    yield file
    folder = hashlib.sha256(os.fsencode(file.parent.resolve())).hexdigest()[:16]
    with suppress(RuntimeError):  # the user has no home folder
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        yield caches / "care-sim" / folder / file.name


def _stamp(form: str, sources: Iterable[Path]) -> str:
    """Tells the sources as they are now from the same at another time."""
    stamps = [file_stamp(source)[1:] for source in sources if source.is_file()]
    return hashlib.sha256(repr((form, stamps)).encode()).hexdigest()


def _kept(place: Path, stamp: str, make: Callable[[], pa.Table]) -> pa.Table | None:
    """The table in the file `place`, made if it is not there; None where none can be kept."""
    table = _mapped(place, stamp)
    if table is not None:
        return table
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    with _alone(place.parent):
        # Another process may have made it while this one waited.
        table = _mapped(place, stamp)
        if table is None and _can_be_written(place):
            table = make().replace_schema_metadata({_STAMP: stamp})
            with suppress(OSError):  # the disk is full: it stays in memory alone
                _write(place, table)
                table = _mapped(place, stamp) or table
    return table


def _can_be_written(place: Path) -> bool:
    try:
        check_output(place, ARROW)
    except (OSError, InvalidInput):
        return False
    return True


def _mapped(place: Path, stamp: str) -> pa.Table | None:
    """The table of the file, which stays on the disk until it is read; None of another one."""
    try:
        table = pa.ipc.open_file(pa.memory_map(os.fspath(place))).read_all()
    # Arrow maps no file whose name is not UTF-8.
    except (OSError, UnicodeError, pa.ArrowException):
        return None
    return table if (table.schema.metadata or {}).get(_STAMP) == stamp.encode() else None


def _write(place: Path, table: pa.Table) -> None:
    with replacing(place, ARROW) as unfinished, unfinished.open("wb") as file:
        with pa.ipc.new_file(file, table.schema) as writer:
            writer.write_table(table)
        # On the disk before it gets its name: after a power cut it would else be there, and empty.
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Other processes that ask for the same wait meanwhile."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # a folder that may not be listed
        yield
        return
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
