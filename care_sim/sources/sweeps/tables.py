"""CSV files of numbers, and times in one of the usual units."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import csv

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats

UNITS_S = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Times from so large a number on are counts of nanoseconds, microseconds, milliseconds since 1970;
smaller ones are seconds.
"""


def read_csv(path: Path, headless: bool = False) -> Any:
    """Return a CSV file as an Arrow table; without a heading its columns are f0, f1, and so on.

    Raises InvalidInput for a file that is missing or no table.
    """
    options = csv.ReadOptions(autogenerate_column_names=headless, use_threads=False)
    try:
        return csv.read_csv(path, read_options=options)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        told = " ".join(str(error).split())[:200]
        raise InvalidInput(f"{path}: no CSV table ({told})") from error


def columns_of(path: Path, table: Any, names: Sequence[str]) -> Floats:
    """Return (n, k) the named columns as numbers; an empty cell is NaN.

    Raises InvalidInput for a column that is missing, there twice, or holds text.
    """
    columns = []
    for name in names:
        if table.column_names.count(name) != 1:
            known = ", ".join(table.column_names)[:200]
            raise InvalidInput(f"{path}: must have one column {name}, has {known}")
        try:
            columns.append(table[name].cast(pyarrow.float64(), safe=False).to_numpy())
        except (ValueError, pyarrow.ArrowException) as error:
            raise InvalidInput(f"{path}: the column {name} must hold numbers") from error
    return np.column_stack(columns)


def in_seconds(times: Floats) -> Floats:
    """Return `times` (n,) in seconds, whichever of the `UNITS_S` they are."""
    most = np.abs(times).max(initial=0.0)
    return times * next((unit for least, unit in UNITS_S if most >= least), 1.0)
