"""JSON of the user's: whatever is wrong with it is a ValueError."""

import json
from collections.abc import Callable
from typing import Any

MOST_LEVELS = 200
"""Levels that lists and maps may be nested: more than any file here needs, few enough for all that
walk them.
"""


def parsed(text: str | bytes, taken: Callable[[dict[str, Any]], object] | None = None) -> Any:
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
