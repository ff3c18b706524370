"""The JSON files of a nuScenes database: rows of plain data, each field of its kind."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.base.json_text import json_content, listed_values
from care_sim.core.arrays import Floats

JsonRow = dict[str, Any]

LARGEST_TABLE = 2**33
"""Bytes of a file: several times the largest table of all of nuScenes (2.6 million recordings of
half a kilobyte).
"""
FIELDS: dict[str, dict[str, type]] = {
    "scene": {"name": str, "first_sample_token": str, "last_sample_token": str},
    "sample": {"timestamp": int, "next": str},
    "sample_data": {
        "sample_token": str,
        "ego_pose_token": str,
        "calibrated_sensor_token": str,
        "filename": str,
        "is_key_frame": bool,
        "timestamp": int,
    },
    "calibrated_sensor": {
        "sensor_token": str,
        "translation": list,
        "rotation": list,
        "camera_intrinsic": list,
    },
    "sensor": {"channel": str},
    "ego_pose": {"translation": list, "rotation": list},
    "sample_annotation": {
        "sample_token": str,
        "instance_token": str,
        "visibility_token": str,
        "translation": list,
        "size": list,
        "rotation": list,
        "num_lidar_pts": int,
        "num_radar_pts": int,
    },
    "instance": {"category_token": str},
    "category": {"name": str},
    "visibility": {"level": str},
}
"""What is read of each table, beside its token."""
KIND_WORDS = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
"""What the kinds of values are called."""


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises InvalidInput for a file that is missing, truncated or larger than `LARGEST_TABLE`.
    """
    try:
        return json_content(path, LARGEST_TABLE)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def table_rows(path: Path, is_needed: Callable[[JsonRow], bool] | None = None) -> Iterator[JsonRow]:
    """The rows of a table one by one, those that are needed, with their token and `FIELDS` alone.

    Raises InvalidInput as `read_json` does, for what is no list, and for the first needed row that
    lacks a field or has another kind of value in it.
    """
    kinds = {"token": str, **FIELDS[path.stem]}
    wanted = [*kinds.values()]
    for number, row in enumerate(_values(path)):
        if not isinstance(row, dict):
            raise InvalidInput(f"{path}: row {number} must be a map of fields")
        if is_needed is not None and not is_needed(row):
            continue
        taken = {name: row.get(name) for name in kinds}
        # Not isinstance: to Python true is an int.
        if [*map(type, taken.values())] != wanted:
            raise InvalidInput(f"{path}: {_what_is_wrong(row, number, kinds)}")
        yield taken


def check_tokens(path: Path, tokens: list[str]) -> None:
    """Raise InvalidInput for a token that stands twice in a table."""
    if len(set(tokens)) < len(tokens):
        (token, count), *_ = Counter(tokens).most_common(1)
        raise InvalidInput(f"{path}: {count} rows with the token {token!r}")


def finite_numbers(value: object, *shape: int) -> Floats | None:
    """A JSON value as an array of `shape`, None for one that is not so many finite numbers."""
    try:
        values = np.array(value)
    except ValueError:
        return None
    if values.shape != shape or values.dtype.kind not in "if" or not np.isfinite(values).all():
        return None
    return values.astype(float)


def _values(path: Path) -> Iterator[Any]:
    try:
        yield from listed_values(path, LARGEST_TABLE)
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path}: no readable JSON file ({error})") from error


def _what_is_wrong(row: JsonRow, number: int, kinds: dict[str, type]) -> str:
    which = f"row {row.get('token') or number}"
    name = next(name for name, kind in kinds.items() if type(row.get(name)) is not kind)
    return (
        f"{which}: {name} must be {KIND_WORDS[kinds[name]]}, got {row[name]!r}"
        if name in row
        else f"{which} lacks {name!r}"
    )
