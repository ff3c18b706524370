"""The tables of a training run, as CSV."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from care_sim.base.errors import InvalidInput
from care_sim.base.files import check_file_size

_Row = TypeVar("_Row")


def read_table(
    path: Path, columns: Sequence[str], row_of: Callable[[list[str]], _Row]
) -> list[_Row]:
    """The rows of a table, none of one that is not there; `row_of` raises ValueError for one that
    is damaged. Raises InvalidInput for a damaged file.
    """
    if not path.exists():
        return []
    try:
        check_file_size(path)
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        if head != [*columns]:
            raise ValueError(f"its columns are not {', '.join(columns)}")
        return [row_of(row) for row in rows]
    except (ValueError, csv.Error) as error:
        raise InvalidInput(f"{path} is damaged: {error}") from error
