"""CSV tables of a user. This module loads PyArrow, so import it where a table is read."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import csv

from care_sim.base.errors import InvalidInput


def read_csv(path: Path, headless: bool = False, texts: Sequence[str] = ()) -> Any:
    """Return a CSV file as an Arrow table; without a heading its columns are f0, f1, and so on.
    The columns `texts` hold texts, even if these look like numbers or times.

    Raises InvalidInput for a file that is missing or no table.
    """
    options = csv.ReadOptions(autogenerate_column_names=headless, use_threads=False)
    types = csv.ConvertOptions(column_types=dict.fromkeys(texts, pyarrow.string()))
    try:
        return csv.read_csv(path, read_options=options, convert_options=types)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        told = " ".join(str(error).split())[:200]
        raise InvalidInput(f"{path}: no CSV table ({told})") from error


def columns_of(path: Path, table: Any, names: Sequence[str]) -> NDArray[np.float64]:
    """Return (n, k) the named columns as numbers; an empty cell is NaN.

    Raises InvalidInput for a column that is missing, there twice, or holds text.
    """
    columns = []
    for name in names:
        _check_column(path, table, name)
        try:
            columns.append(table[name].cast(pyarrow.float64(), safe=False).to_numpy())
        except (ValueError, pyarrow.ArrowException) as error:
            raise InvalidInput(f"{path}: the column {name} must hold numbers") from error
    return np.column_stack(columns)


def texts_of(path: Path, table: Any, name: str) -> list[str]:
    """Return the named column as texts; an empty cell is an empty text. Raises as `columns_of`."""
    _check_column(path, table, name)
    return [text or "" for text in table[name].cast(pyarrow.string()).to_pylist()]


def _check_column(path: Path, table: Any, name: str) -> None:
    if table.column_names.count(name) != 1:
        known = ", ".join(table.column_names)[:200]
        raise InvalidInput(f"{path}: must have one column {name}, has {known}")
