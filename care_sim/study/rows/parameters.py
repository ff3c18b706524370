"""The parameters of a task and their allowed values, which journals and columns of results restore
exactly. Options of commands import this module, so it imports nothing heavy.
"""

import ast
import os
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput, one_line, shown

Parameters = tuple[tuple[str, Any], ...]
"""Names and values, of a scenario's physics, a policy or a detector."""

_ALLOWED = "a flag, a number of at most 64 bits, a text, or a list of one kind of these"
_DEEPEST = 4
"""Levels that lists may be nested."""
_WHOLE = 2**63
"""Whole numbers have 64 bits in a column: from minus this to less than this."""
_LONGEST = 8192
"""Characters of a parameter: a path and its name fit."""


def checked_parameters(given: Iterable[tuple[str, Any]], whose: str) -> Parameters:
    """Return the parameters with values of Python's own types, lists as tuples, paths as texts.

    Raises InvalidInput for values that journals and results files cannot restore: sets, maps,
    bytes, None (a column's missing value), NaN, halves of characters, lists of mixed kinds.
    """
    name_of, value_of = f"the name of a {whose} parameter", f"{whose} parameter"
    return tuple(
        (_checked(name_of, name, _text, "a text"), _checked(f"{value_of} {name}", value))
        for name, value in given
    )


def _checked(
    what: str, value: Any, read: Callable[[Any], Any] | None = None, allowed: str = _ALLOWED
) -> Any:
    try:
        return (read or _column_value)(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise InvalidInput(f"{one_line(what)} must be {allowed}, got {shown(value)}") from error


def _column_value(value: Any) -> Any:
    plain = _plain(value)
    _kind(plain)
    return plain


def _plain(value: Any, levels: int = _DEEPEST) -> Any:
    """Return the value in Python's own types. Raises ValueError or TypeError if it is not
    allowed.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) and levels:
        return tuple(_plain(each, levels - 1) for each in value)
    # Before int, of which bool is a subclass.
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and -_WHOLE <= value < _WHOLE:
        return int(value)
    # NaN is no value: no row with it would be equal to itself.
    if isinstance(value, float) and value == value:
        return float(value)
    # Texts pass through fspath unchanged. Anything else that is no path raises TypeError.
    return _text(os.fspath(value))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    # Lone surrogates, which no file can hold, raise here.
    value.encode()
    # A subclass of str, such as an enum, becomes a plain str.
    return str.__str__(value)


def _kind(value: Any) -> Any:
    """Return the kind of a column of such values. Raises ValueError for a list of several kinds."""
    if not isinstance(value, tuple):
        # A column of numbers may mix whole ones with others.
        return float if type(value) is int else type(value)
    kinds = {_kind(each) for each in value}
    if len(kinds) > 1:
        raise ValueError
    return (*kinds,)


def parameters(texts: Sequence[str]) -> Parameters:
    """Parameters given as NAME=VALUE. Raises InvalidInput for another form, and for a name that is
    given twice.
    """
    pairs = tuple(_pair(text) for text in texts)
    for name, count in Counter(name for name, _ in pairs).items():
        if count > 1:
            raise InvalidInput(f"a parameter is given once, got {shown(name)} {count} times")
    return pairs


def _pair(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise InvalidInput(f"parameters are given as NAME=VALUE, got {shown(text)}")
    if len(text) > _LONGEST:
        raise InvalidInput(
            f"a parameter must be at most {_LONGEST} characters long, got {shown(text)}"
        )
    # A Windows path holds backslashes that Python warns of as escapes.
    with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
        try:
            literal = ast.literal_eval(value)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            literal = value  # no literal, or one nested deeper than any parameter is
    return name, tuple(literal) if isinstance(literal, list) else literal
