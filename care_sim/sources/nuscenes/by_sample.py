"""What was recorded and annotated at every sample, in columns (Apache Arrow).

The tables `sample_data`, `ego_pose` and `sample_annotation` of all of nuScenes hold six million
rows in 2.6 GB of text, most of which are of no use here. They are read row by row into one table
with a row per sample, which a file can hold and processes can share.
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

LONG_TABLES = ("sample_data", "ego_pose", "sample_annotation")
FORM = "1"
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
_ROWS_AT_ONCE = 2**14

TablePath = Callable[[str], Path]
"""The file of a table by its name."""


def by_sample(path: TablePath, samples: Sequence[str]) -> pa.Table:
    """A row for each of the tokens `samples`, in their order: `recordings` and `boxes`, lists of
    rows in the order of their tables.

    Only recordings of keyframes are kept, about one in six. Each has the car's `pose`, null where
    `ego_pose` has none. Instead of numbers of points a box tells whether it `has_points`. What is
    not as many numbers as it should be is NaN, so that only who asks for it is refused.

    Raises InvalidInput as `table_rows` does, for a token that stands twice in a table, and for a
    box of a sample that there is not.
    """
    tokens = pa.array(samples, pa.string())
    boxes = _boxes(path)
    # A box of a sample that there is not would be missed in silence.
    is_nowhere = pc.is_null(pc.index_in(boxes["sample_token"], value_set=tokens))
    if pc.any(is_nowhere).as_py():
        token = boxes["sample_token"].filter(is_nowhere)[0].as_py()
        raise InvalidInput(f"{path('sample')}: no row with the token {token!r}")
    grouped_boxes = _grouped(boxes, tokens)
    return pa.table({"recordings": _grouped(_recordings(path), tokens), "boxes": grouped_boxes})


def _boxes(path: TablePath) -> pa.Table:
    table = path("sample_annotation")
    rows = (
        {**row, "has_points": row["num_lidar_pts"] + row["num_radar_pts"] > 0}
        for row in table_rows(table)
    )
    return _columns(table, rows, BOXES)


def _recordings(path: TablePath) -> pa.Table:
    """The recordings of keyframes, with their poses."""
    table = path("sample_data")
    # A row that lacks the field stays, to be refused.
    rows = table_rows(table, lambda row: row.get("is_key_frame") is not False)
    found = _columns(table, rows, RECORDINGS)
    poses = _poses(path("ego_pose"), set(found["ego_pose_token"].to_pylist()))
    where = pc.index_in(found["ego_pose_token"], value_set=poses["token"].combine_chunks())
    places = poses.drop_columns("token").to_struct_array().combine_chunks()
    return found.append_column("pose", places.take(where.combine_chunks()))


def _poses(path: Path, tokens: set[str]) -> pa.Table:
    """Poses are recorded for every sweep and picture; those of the `tokens` alone are kept."""
    # A row that lacks its token stays, to be refused.
    rows = table_rows(path, lambda row: row.get("token", None) in tokens or "token" not in row)
    return _columns(path, rows, POSES)


def _columns(path: Path, rows: Iterable[JsonRow], schema: pa.Schema) -> pa.Table:
    """The rows of the table in the file `path`, whose tokens must all be different."""
    # A few at a time: as Python objects they take several times the memory.
    left = iter(rows)
    batches = []
    while some := list(islice(left, _ROWS_AT_ONCE)):
        columns = [_column([row[field.name] for row in some], field.type) for field in schema]
        batches.append(pa.record_batch(columns, schema))
    table = pa.Table.from_batches(batches, schema)
    check_tokens(path, table["token"].to_pylist())
    return table


def _column(values: list[Any], kind: pa.DataType) -> pa.Array:
    if not pa.types.is_fixed_size_list(kind):
        return pa.array(values, kind)
    count = kind.list_size
    numbers = finite_numbers(values, len(values), count)
    if numbers is None:
        # One of them is odd, and must not spoil the others.
        none = np.full(count, np.nan)
        found = (finite_numbers(value, count) for value in values)
        numbers = np.array([none if value is None else value for value in found])
    return pa.FixedSizeListArray.from_arrays(numbers.ravel(), count)


def _grouped(table: pa.Table, samples: pa.Array) -> pa.ListArray:
    """The rows of each of the samples as a list; those of no sample are left out."""
    numbers = pc.index_in(table["sample_token"], value_set=samples)
    # The sort is stable and puts nulls last.
    order = pc.sort_indices(numbers)[: len(numbers) - numbers.null_count]
    edges = np.searchsorted(numbers.take(order).to_numpy(), np.arange(len(samples) + 1))
    rows = table.drop_columns("sample_token").take(order).combine_chunks()
    return pa.ListArray.from_arrays(
        pa.array(edges, pa.int32()), rows.to_struct_array().combine_chunks()
    )
