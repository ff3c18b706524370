"""Columns of Feather files; what is missing or broken is named in one line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import feather

from care_sim.errors import InvalidInput

Columns = dict[str, NDArray[Any]]


def read_columns(path: Path, types: Mapping[str, type]) -> Columns:
    """The named columns of a Feather file as arrays of the given types.

    Raises InvalidInput for a file that is missing or truncated, lacks a column, or has an empty or infinite value.
    """
    try:
        table = feather.read_table(path)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, pyarrow.ArrowException) as error:
        raise InvalidInput(f"{path}: no readable Feather file ({_first_line(error)})") from error
    missing = sorted(set(types) - set(table.column_names))
    if missing:
        raise InvalidInput(f"{path}: lacks the column {missing[0]!r}; needed: {', '.join(types)}")
    return {name: _column(path, table, name, kind) for name, kind in types.items()}


def _column(path: Path, table: pyarrow.Table, name: str, kind: type) -> NDArray[Any]:
    column = table[name]
    if column.null_count:
        raise InvalidInput(f"{path}: column {name!r} has {column.null_count} empty values")
    try:
        values: NDArray[Any] = np.asarray(column.to_pylist(), dtype=kind)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{path}: column {name!r} must hold {kind.__name__} values, has {column.type}") from error
    if kind is float and not np.isfinite(values).all():
        raise InvalidInput(f"{path}: column {name!r} has a value that is not finite")
    return values


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
