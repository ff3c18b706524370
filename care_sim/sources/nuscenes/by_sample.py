"""What was recorded and annotated at every sample, in columns (Apache Arrow).

The tables `sample_data`, `ego_pose` and `sample_annotation` of all of nuScenes hold six million
rows in 2.6 GB of text, most of which are of no use here. They are read row by row into tables with
a list of rows per sample, which files can hold and processes can share.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.table_files import (
    JsonRow,
    check_tokens,
    finite_numbers,
    table_rows,
)

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
