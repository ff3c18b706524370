"""The JSON files of a nuScenes database: rows of plain data, each field of its kind."""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.base.json_text import json_content

JsonRow = dict[str, Any]

LARGEST_TABLE = 2**33
"""Bytes of a file: several times the largest table of all of nuScenes (2.6 million recordings of
half a kilobyte).
"""
DROPPED = object()
"""Stands for a row that was not kept, so that rows are still counted as in the file."""
KIND_WORDS = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
"""What the kinds of values are called."""


def read_json(path: Path, taken: Callable[[JsonRow], object] | None = None) -> Any:
    """The content of a JSON file, every map in it replaced by what is `taken` of it.

    Raises InvalidInput for a file that is missing, truncated or larger than `LARGEST_TABLE`.
    """
    try:
        return json_content(path, LARGEST_TABLE, taken)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def indexed_rows(path: Path, content: object, kinds: Mapping[str, type]) -> dict[str, JsonRow]:
    """The rows of a table's `content` by token, each with fields of the `kinds`.

    Raises InvalidInput for the first row that has other fields, and for a token that stands twice.
    """
    if not isinstance(content, list):
        raise InvalidInput(f"{path}: must hold a list of rows")
    for number, row in enumerate(content):
        if row is DROPPED:
            continue
        if not isinstance(row, dict):
            raise InvalidInput(f"{path}: row {number} must be a map of fields")
        for name, kind in kinds.items():
            # Not isinstance: to Python true is an int.
            if type(row.get(name)) is not kind:
                raise InvalidInput(f"{path}: {_what_is_wrong(row, number, name, kind)}")
    return _by_token(path, [row for row in content if row is not DROPPED])


def _what_is_wrong(row: JsonRow, number: int, name: str, kind: type) -> str:
    which = f"row {row.get('token') or number}"
    return (
        f"{which}: {name} must be {KIND_WORDS[kind]}, got {row[name]!r}"
        if name in row
        else f"{which} lacks {name!r}"
    )


def _by_token(path: Path, rows: list[JsonRow]) -> dict[str, JsonRow]:
    indexed = {row["token"]: row for row in rows}
    if len(indexed) < len(rows):
        (token, count), *_ = Counter(row["token"] for row in rows).most_common(1)
        raise InvalidInput(f"{path}: {count} rows with the token {token!r}")
    return indexed
