"""The JSON files of a nuScenes database: rows of plain data, each field of its kind, and what was
recorded and annotated at every sample, in columns (Apache Arrow).

The tables `sample_data`, `ego_pose` and `sample_annotation` of all of nuScenes hold six million
rows in 2.6 GB of text, most of which are of no use here. They are read row by row into tables with
a list of rows per sample, which are kept in files that later processes map into their memory.
"""

import fcntl
import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

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


FORM = "2"
"""Raised whenever the same files make another table."""
_VECTOR = pa.list_(pa.float64(), 3)
_QUATERNION = pa.list_(pa.float64(), 4)
POSES = pa.schema({"token": pa.string(), "translation": _VECTOR, "rotation": _QUATERNION})
RECORDINGS = pa.schema(
    {
        "token": pa.string(),
        "sample_token": pa.string(),
        "ego_pose_token": pa.string(),
        "calibrated_sensor_token": pa.string(),
        "filename": pa.string(),
        "is_key_frame": pa.bool_(),
        "timestamp": pa.int64(),
    }
)
BOXES = pa.schema(
    {
        "token": pa.string(),
        "sample_token": pa.string(),
        "instance_token": pa.string(),
        "visibility_token": pa.string(),
        "translation": _VECTOR,
        "size": _VECTOR,
        "rotation": _QUATERNION,
        "has_points": pa.bool_(),
    }
)
_ROWS_AT_ONCE = 2**12

TablePath = Callable[[str], Path]
"""The file of a table by its name."""


def boxes_by_sample(path: TablePath, samples: Sequence[str]) -> pa.Table:
    """The boxes of each of the tokens `samples`, in their order: a column of lists of rows, in the
    order of `sample_annotation`. Instead of numbers of points each tells whether it `has_points`.

    Raises InvalidInput as `table_rows` does, for a token that stands twice, and for a box of a
    sample that there is not.
    """
    tokens = _column(path("sample"), samples, pa.string())
    return _grouped(_boxes(path, tokens), tokens)


def recordings_by_sample(
    path: TablePath, samples: Sequence[str], lidars: Sequence[str], cameras: Sequence[str]
) -> pa.Table:
    """The recordings of each of the tokens `samples`, as `boxes_by_sample` has the boxes: those of
    keyframes, and all of the calibrated sensors `lidars`, together about one in four. Those of the
    lidars, and of the `cameras` at keyframes, have the `pose` of the car, null where `ego_pose`
    lacks it.

    Raises InvalidInput as `table_rows` does, and for a token that stands twice.
    """
    tokens = _column(path("sample"), samples, pa.string())
    # No other recording of a camera is read.
    posed = [*lidars, *cameras]
    return _grouped(_with_poses(path, _recordings(path, lidars), posed), tokens)


def _boxes(path: TablePath, samples: pa.Array) -> pa.Table:
    table = path("sample_annotation")
    rows = (
        {**row, "has_points": row["num_lidar_pts"] + row["num_radar_pts"] > 0}
        for row in table_rows(table)
    )
    boxes = _columns(table, rows, BOXES)
    # A box of a sample that there is not would be missed in silence.
    is_nowhere = pc.is_null(pc.index_in(boxes["sample_token"], value_set=samples))
    if pc.any(is_nowhere).as_py():
        token = boxes["sample_token"].filter(is_nowhere)[0].as_py()
        raise InvalidInput(f"{path('sample')}: no row with the token {token!r}")
    return boxes


def _recordings(path: TablePath, lidars: Sequence[str]) -> pa.Table:
    known = frozenset(lidars)

    def is_needed(row: JsonRow) -> bool:
        # A row that lacks the field stays, to be refused.
        is_between = row.get("is_key_frame") is False
        return not is_between or str(row.get("calibrated_sensor_token")) in known

    return _columns(path("sample_data"), table_rows(path("sample_data"), is_needed), RECORDINGS)


def _with_poses(path: TablePath, recordings: pa.Table, sensors: Sequence[str]) -> pa.Table:
    known = _column(path("calibrated_sensor"), sensors, pa.string())
    is_posed = pc.is_in(recordings["calibrated_sensor_token"], known)
    tokens = pc.if_else(is_posed, recordings["ego_pose_token"], None)
    poses = _poses(path("ego_pose"), set(tokens.drop_null().to_pylist()))
    places = poses.drop_columns("token").to_struct_array().combine_chunks()
    where = pc.index_in(tokens, value_set=poses["token"].combine_chunks())
    return recordings.append_column("pose", places.take(where.combine_chunks()))


def _poses(path: Path, tokens: set[str]) -> pa.Table:
    """Poses are recorded for every sweep and picture; those of the `tokens` alone are kept."""
    # A row that lacks its token stays, to be refused.
    rows = table_rows(path, lambda row: "token" not in row or str(row["token"]) in tokens)
    return _columns(path, rows, POSES)


def _columns(path: Path, rows: Iterable[JsonRow], schema: pa.Schema) -> pa.Table:
    """The rows of the table in the file `path`, whose tokens must all be different."""
    # A few at a time: as Python objects they take several times the memory.
    left = iter(rows)
    batches = []
    while some := list(islice(left, _ROWS_AT_ONCE)):
        columns = [_column(path, [row[field.name] for row in some], field.type) for field in schema]
        batches.append(pa.record_batch(columns, schema))
    table = pa.Table.from_batches(batches, schema)
    _check_tokens(path, table["token"])
    return table


def _check_tokens(path: Path, tokens: pa.ChunkedArray) -> None:
    # By their hashes, as all tokens at once take much memory; equal hashes are looked into.
    hashes = [np.array([*map(hash, some.to_pylist())]) for some in tokens.chunks]
    if len(hashes) and len(np.unique(np.concatenate(hashes))) < len(tokens):
        check_tokens(path, tokens.to_pylist())


def _column(path: Path, values: Sequence[Any], kind: pa.DataType) -> pa.Array:
    if not pa.types.is_fixed_size_list(kind):
        try:
            return pa.array(values, kind)
        except (UnicodeEncodeError, OverflowError) as error:
            raise InvalidInput(
                f"{path}: half a character or too large a number ({error})"
            ) from error
    count = kind.list_size
    numbers = finite_numbers(values, len(values), count)
    if numbers is None:
        # One of them is odd, and must not spoil the others.
        none = np.full(count, np.nan)
        found = (finite_numbers(value, count) for value in values)
        numbers = np.array([none if value is None else value for value in found])
    return pa.FixedSizeListArray.from_arrays(numbers.ravel(), count)


def _grouped(table: pa.Table, samples: pa.Array) -> pa.Table:
    """A column `rows` with a list for each of the samples; rows of no sample are left out."""
    numbers = pc.index_in(table["sample_token"], value_set=samples)
    # The sort is stable and puts nulls last.
    order = pc.sort_indices(numbers)[: len(numbers) - numbers.null_count]
    edges = np.searchsorted(numbers.take(order).to_numpy(), np.arange(len(samples) + 1))
    # Column by column, and what Arrow keeps for later is given back each time: so the table is
    # never held twice.
    columns = {}
    for name in table.drop_columns("sample_token").column_names:
        columns[name] = table[name].take(order).combine_chunks()
        table = table.drop_columns(name)
        pa.default_memory_pool().release_unused()
    rows = pa.StructArray.from_arrays(list(columns.values()), list(columns))
    return pa.table({"rows": pa.ListArray.from_arrays(pa.array(edges, pa.int32()), rows)})
