"""Rows of a study in a Parquet file."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from care_sim.base.errors import InvalidInput
from care_sim.base.files import parsed_json, replacing
from care_sim.study.rows.schema import Schema
from care_sim.study.run_config import Row

STUDY_NOTE = b"care_sim.study"
"""Key of the metadata that names the study of a file's rows."""
LEFT_OUT_NOTE = b"care_sim.left_out"
"""Key of the metadata with a note on missing rows."""
_ANY = Schema()
"""Columns of any name and type."""


def write_rows(
    rows: Sequence[Row],
    path: Path,
    study: str = "sweep",
    left_out: Sequence[str] = (),
    schema: Schema = _ANY,
) -> None:
    """Write rows, the name of their study and its missing parts to a Parquet file. A column without
    values has its type in `schema`.
    """
    # Rows may have different columns: parameters that only some policies have are None in the
    # others.
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: [row.get(name) for row in rows] for name in names}
    write_columns(
        columns, path, {STUDY_NOTE: study, LEFT_OUT_NOTE: json.dumps([*left_out])}, schema
    )


def write_columns(
    columns: Mapping[str, Any],
    path: Path,
    notes: Mapping[bytes, str] | None = None,
    schema: Schema = _ANY,
) -> None:
    """Write columns to a Parquet file, whole or not at all."""
    arrays = {name: pa.array(column) for name, column in columns.items()}
    # A column without a value has no type of its own, and readers of another file would not agree
    # on one.
    typed = {
        name: column.cast(schema.column(name).type) if column.type == pa.null() else column
        for name, column in arrays.items()
    }
    # Arrow opens no file whose name is not UTF-8, so it gets files that are open.
    table = pa.table(typed).replace_schema_metadata(notes)
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        pq.write_table(table, file, compression="zstd", write_page_checksum=True)


def check_columns(rows: Iterable[Row]) -> None:
    """Raise InvalidInput where one column cannot hold a parameter of all rows, such as a number in
    one and a text in another.
    """
    values: dict[str, dict[tuple[type, Any], None]] = {}
    for row in rows:
        for name, value in row.items():
            if "." in name:
                # By type and value: 1, 1.0 and True are equal, but not the same in a column.
                values.setdefault(name, {})[type(value), value] = None
    for name, held in values.items():
        # One plain type fits a column. PyArrow, which is asked of the rest, imports pandas.
        if len(kinds := {kind for kind, _ in held}) == 1 and kinds <= {bool, int, float, str}:
            continue
        try:
            pa.array([value for _, value in held])
        except pa.ArrowException as error:
            shown = " and ".join(repr(value) for _, value in [*held][:3])
            raise InvalidInput(
                f"one column of results must hold all values of {name}, got {shown}"
            ) from error


def with_tuples(row: Row) -> Row:
    """Return the row with ranges as tuples, which Parquet and JSON hold as lists."""
    return {n: _with_tuples(v) if isinstance(v, list) else v for n, v in row.items()}


def _with_tuples(value: Any) -> Any:
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value


def read_rows(path: Path, schema: Schema | None = None) -> list[Row]:
    """Read rows; with a schema, only its columns. Raises InvalidInput for a file that is damaged,
    is empty, or does not have the schema.
    """
    table = read_table(path)
    # Report the first fault.
    for fault in (schema or _ANY).faults(table):
        raise InvalidInput(f"{path} holds no rows of a study: {fault}")
    known = table.select(schema.known(table.column_names)) if schema else table
    try:
        return [with_tuples(row) for row in known.to_pylist()]
    except (pa.ArrowException, ValueError, OverflowError) as error:
        raise InvalidInput(
            f"{path} is not a readable Parquet file: {_first_line(error)}"
        ) from error


def read_notes(path: Path) -> tuple[str | None, list[str]]:
    """Return the name of a file's study, None without one, and its missing parts. Raises
    InvalidInput for a damaged file, or other notes.
    """
    notes = read_table(path).schema.metadata or {}
    try:
        study = notes[STUDY_NOTE].decode() if STUDY_NOTE in notes else None
        left_out = parsed_json(notes.get(LEFT_OUT_NOTE, b"[]"))
    except ValueError as error:
        raise InvalidInput(f"{path} has notes that cannot be read: {_first_line(error)}") from error
    if not isinstance(left_out, list) or not all(isinstance(each, str) for each in left_out):
        raise InvalidInput(
            f"{path} has notes that cannot be read: what is left out must be a list of texts"
        )
    return study, left_out


def read_table(path: Path) -> pa.Table:
    """Return the table of a file as it is. Raises InvalidInput for a missing or damaged file."""
    if not path.is_file():
        raise InvalidInput(f"no results at {path}; expected a folder that a study wrote")
    try:
        # Files of older versions have no checksums, and are read without them. `pq.read_table`
        # would start threads, and a process that ends soon after can abort (apache/arrow 34314).
        with path.open("rb") as file:
            table = pq.ParquetFile(file, page_checksum_verification=True).read(use_threads=False)
        # Damaged offsets are found here, not as a crash when values are read.
        table.validate(full=True)
        table.column_names  # noqa: B018 (names of broken characters show only now)
        return table
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise InvalidInput(
            f"{path} is not a readable Parquet file: {_first_line(error)}"
        ) from error


def _first_line(error: BaseException) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)
