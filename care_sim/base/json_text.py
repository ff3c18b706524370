"""JSON from a user's files: whatever is wrong with it is a ValueError."""

import json
import re
import stat
from collections.abc import Iterator
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
MOST_CHARACTERS = 2**18
"""Characters of one value of a list that is read value by value: five hundred times a row."""
_CHUNK = 2**21
_OPENED = re.compile(r"[ \t\n\r]*\[[ \t\n\r]*(\][ \t\n\r]*)?")
_VALUE_ENDED = re.compile(r"[ \t\n\r]*([,\]])[ \t\n\r]*")


def json_content(path: Path, most: int = MOST_BYTES) -> Any:
    """The content of a file of at most `most` bytes.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` and `parsed_json`
    do, and for one that the memory does not hold.
    """
    # The size is looked at first, so that a file of another kind is refused before it fills the
    # memory.
    check_file_size(path, most)
    try:
        return parsed_json(path.read_text(encoding="utf-8"))
    except MemoryError as error:
        raise ValueError("it is larger than the memory that is free") from error


def listed_values(path: Path, most: int = MOST_BYTES) -> Iterator[Any]:
    """The values of the list that a file of at most `most` bytes holds, one after the other: only
    some of them lie in memory at a time. Each may be `MOST_CHARACTERS` long.

    Raises OSError for a file that cannot be read, ValueError as `check_file_size` does, for what is
    no JSON or no list, and for a value too deep for Python; values before it have come by then.
    """
    check_file_size(path, most)
    decode = json.JSONDecoder().raw_decode
    with path.open(encoding="utf-8") as file:
        text = file.read(_CHUNK)
        opened = _OPENED.match(text)
        if opened is None:
            raise ValueError("it holds no list")
        place = opened.end()
        is_open = opened[1] is None
        number = 0
        while is_open:
            number += 1
            # From here on the text holds the next value as a whole, or all that is left.
            if len(text) - place < MOST_CHARACTERS:
                text, place = text[place:] + file.read(_CHUNK), 0
            try:
                value, place = decode(text, place)
            except RecursionError as error:
                raise ValueError("it is nested too deep") from error
            # The place that the error tells is one of the text in memory, not of the file.
            except json.JSONDecodeError as error:
                limit = f"at most {MOST_CHARACTERS} characters"
                raise ValueError(f"value {number} is no JSON of {limit}: {error.msg}") from error
            yield value
            ended = _VALUE_ENDED.match(text, place)
            if ended is None:
                raise ValueError("neither a comma nor the end of the list after a value")
            place = ended.end()
            is_open = ended[1] == ","
        if place < len(text) or file.read(1):
            raise ValueError("text after the end of the list")


def check_file_size(path: Path, most: int = MOST_BYTES) -> None:
    """Raise ValueError for a file of more than `most` bytes, and for what is none, such as a device
    without end.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):
        raise ValueError("it is not a regular file")
    if there.st_size > most:
        raise ValueError(f"it holds {there.st_size} bytes and may hold {most}")


def parsed_json(text: str | bytes) -> Any:
    """The content of a text.

    Raises ValueError for what is no JSON, and for what is nested deeper than `MOST_LEVELS`, or so
    deep that Python cannot read it.
    """
    try:
        content = json.loads(text)
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
