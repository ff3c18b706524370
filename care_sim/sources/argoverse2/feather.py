"""Columns of Feather files. What is missing or broken is named in one line."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import feather, types

from care_sim.base.errors import InvalidInput
from care_sim.sources.plausible import ValueRange

Columns = dict[str, NDArray[Any]]


def read_columns(
    path: Path, kinds: Mapping[str, type], ranges: Mapping[str, ValueRange]
) -> Columns:
    """The named columns of a Feather file as arrays of the given kinds, int, float or str; numbers
    lie in their ranges.

    Raises InvalidInput for a file that is missing or truncated, lacks a column, holds another kind
    in it, or has an empty or infinite value, or one beyond its range.
    """
    try:
        with path.open("rb") as file:
            table = feather.read_table(file)
        table.validate(full=True)
        # Names that are no UTF-8 show only when they are read.
        names = table.column_names
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, pyarrow.ArrowException, UnicodeDecodeError) as error:
        raise InvalidInput(f"{path}: no readable Feather file ({_first_line(error)})") from error
    for name in kinds:
        count = names.count(name)
        if count != 1:
            found = "lacks the column" if not count else f"has {count} columns"
            raise InvalidInput(f"{path}: {found} {name!r}; needed: {', '.join(kinds)}")
    columns = {name: _column(path, table[name], name, kind) for name, kind in kinds.items()}
    for name, (least, most) in ranges.items():
        fits = (columns[name] >= least) & (columns[name] <= most)
        if not fits.all():
            row = fits.argmin()
            got = f"got {columns[name][row]:g} in row {row}"
            raise InvalidInput(f"{path}: column {name!r} must lie in [{least:g}, {most:g}], {got}")
    return columns


def _column(path: Path, column: pyarrow.ChunkedArray, name: str, kind: type) -> NDArray[Any]:
    if not _HOLDS[kind](column.type):
        raise InvalidInput(
            f"{path}: column {name!r} must hold {kind.__name__} values, has {column.type}"
        )
    if column.null_count:
        raise InvalidInput(f"{path}: column {name!r} has {column.null_count} empty values")
    values: NDArray[Any] = np.asarray(column.to_pylist() if kind is str else column, dtype=kind)
    if kind is float and not np.isfinite(values).all():
        raise InvalidInput(
            f"{path}: column {name!r} has a value that is not finite, in row "
            f"{np.isfinite(values).argmin()}"
        )
    return values


def _is_text(kind: pyarrow.DataType) -> bool:
    kind = kind.value_type if types.is_dictionary(kind) else kind
    return bool(types.is_string(kind) or types.is_large_string(kind))


_HOLDS: dict[type, Callable[[pyarrow.DataType], bool]] = {
    int: types.is_integer,
    float: lambda kind: types.is_floating(kind) or types.is_integer(kind),
    str: _is_text,
}


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
