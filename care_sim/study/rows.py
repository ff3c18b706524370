"""Rows of episodes in a Parquet file."""

import os
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from care_sim.errors import InvalidInput
from care_sim.study.config import PLAIN_FIELDS
from care_sim.study.episode import Row
from care_sim.types import Outcome

REQUIRED = {*PLAIN_FIELDS, *Outcome.__dataclass_fields__}
"""Columns without which a file is none of ours."""
STUDY = b"care_sim.study"
"""Where the schema of a file names the study that its rows belong to."""


def write_rows(rows: Sequence[Row], path: Path, study: str = "sweep") -> None:
    """Write rows and the name of their study to a Parquet file in one move: readers see the old file or the new."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: pa.array([row.get(name) for row in rows]) for name in names}
    measured = {
        name: column.cast(pa.float64()) if column.type == pa.null() else column for name, column in columns.items()
    }
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    pq.write_table(pa.table(measured).replace_schema_metadata({STUDY: study}), unfinished)
    unfinished.replace(path)


def with_tuples(row: Row) -> Row:
    """The row with ranges as tuples again, which Parquet and JSON hold as lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in row.items()}


def read_rows(path: Path) -> list[Row]:
    """Read rows back. Raises InvalidInput for a file that is damaged or holds no episodes."""
    rows = [with_tuples(row) for row in _read(path).to_pylist()]
    missing = REQUIRED - set(rows[0] if rows else ())
    if missing:
        raise InvalidInput(f"{path} holds no rows of episodes: it lacks {', '.join(sorted(missing))}")
    return rows


def read_study(path: Path) -> str | None:
    """The name of the study that wrote a file, None without one. Raises InvalidInput for a damaged file."""
    name = (_read(path).schema.metadata or {}).get(STUDY)
    return name.decode() if name else None


def _read(path: Path) -> pa.Table:
    if not path.is_file():
        raise InvalidInput(f"no results at {path}; expected a folder that a study wrote")
    try:
        return pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise InvalidInput(f"{path} is not a readable Parquet file: {str(error).splitlines()[0]}") from error
