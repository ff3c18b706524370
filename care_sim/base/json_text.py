"""JSON from a user's files: whatever is wrong with it is a ValueError."""

import json
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

MOST_LEVELS = 200
"""Levels that lists and maps may be nested: more than any file here needs, few enough for all that
walk them.
"""
MOST_BYTES = 2**28
"""Bytes of a file: more than the longest of ours, the configurations of a study (100,000 tasks of 2
kB).
"""


def json_content(
    path: Path, most: int = MOST_BYTES, taken: Callable[[dict[str, Any]], object] | None = None
) -> Any:
    """The content of a file of at most `most` bytes, every map in it replaced by what is `taken` of
    it.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` and `parsed_json`
    do, and for one that the memory does not hold.
    """
    # The size is looked at first, so that a file of another kind is refused before it fills the
    # memory.
    check_file_size(path, most)
    try:
        return parsed_json(path.read_text(encoding="utf-8"), taken)
    except MemoryError as error:
        raise ValueError("it is larger than the memory that is free") from error


def check_file_size(path: Path, most: int = MOST_BYTES) -> None:
    """Raise ValueError for a file of more than `most` bytes, and for what is none, such as a device
    without end.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):
        raise ValueError("it is not a regular file")
    if there.st_size > most:
        raise ValueError(f"it holds {there.st_size} bytes and may hold {most}")


def parsed_json(text: str | bytes, taken: Callable[[dict[str, Any]], object] | None = None) -> Any:
    """The content of a text, every map in it replaced by what is `taken` of it.

    Raises ValueError for what is no JSON, and for what is nested deeper than `MOST_LEVELS`, or so
    deep that Python cannot read it.
    """
    try:
        content = json.loads(text, object_hook=taken)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error
    if _is_deep(content):
        raise ValueError(f"it is nested deeper than {MOST_LEVELS} levels")
    return content


def _is_deep(content: object) -> bool:
    """Whether it is; level by level, without recursion."""
    # One pass per level keeps only the lists and maps that lie one level deeper.
    level = [content]
    for _ in range(MOST_LEVELS):
        level = [
            each
            for thing in level
            if isinstance(thing, list | dict)
            for each in (thing.values() if isinstance(thing, dict) else thing)
            if isinstance(each, list | dict)
        ]
        if not level:
            return False
    return True
