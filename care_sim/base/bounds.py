"""What a field of a dataclass may be: stated beside its default, checked when the dataclass is
made, and told by lists.

The kind follows from the default: a flag, text, a whole number, a number, or, where it is bounded,
a range of numbers (low, high). A field whose default is None may stay None. Numbers of any type
become Python's own, so that equal configurations are written alike.
"""

from collections.abc import Iterable
from dataclasses import Field, field, fields
from typing import Any

from care_sim.base.checks import (
    LARGEST_INTEGER,
    check_flag,
    check_known,
    check_number,
    check_range,
    check_whole,
)
from care_sim.base.errors import InvalidInput, shown

_BOUNDS = "bounds"
_NAMES = "names"
_ANY = (float("-inf"), float("inf"))


def bounded(default: Any, least: float, most: float) -> Any:
    """A field whose number, or both numbers of whose range, lie in [least, most]."""
    return field(default=default, metadata={_BOUNDS: (least, most)})


def one_of(default: Any, names: Iterable[str]) -> Any:
    """A field whose text is one of the names."""
    return field(default=default, metadata={_NAMES: tuple(names)})


def allowed(one: Field[Any]) -> str:
    """The bounds or the names of a field as people write them; nothing where it has none."""
    if _NAMES in one.metadata:
        return f"of {', '.join(one.metadata[_NAMES])}"
    if _BOUNDS not in one.metadata:
        return ""
    least, most = one.metadata[_BOUNDS]
    # What is only a limit of the computer's tells nobody anything.
    return f"{least:g} or more" if most == LARGEST_INTEGER else f"{least:g} to {most:,.10g}"


def check_fields(thing: Any, of: str = "") -> None:
    """Check the fields of a frozen dataclass, and make each number the type that it is declared as.

    Raises InvalidInput that names the field, with `of` behind its name.
    """
    for one in fields(thing):
        value = getattr(thing, one.name)
        if value is None and one.default is None:
            continue
        settled = _settled(f"{one.name}{of}", value, one)
        if settled is not value:
            object.__setattr__(thing, one.name, settled)


def _settled(name: str, value: Any, one: Field[Any]) -> Any:
    """A value as the type of its field's default. Raises InvalidInput for what it cannot be."""
    default, bounds = one.default, one.metadata.get(_BOUNDS, _ANY)
    # Flags come before whole numbers: in Python a bool is an int.
    if isinstance(default, bool):
        check_flag(name, value)
    elif isinstance(default, str) or _NAMES in one.metadata:
        _check_name(name, value, one.metadata.get(_NAMES))
    elif isinstance(default, int):
        check_whole(name, value, *bounds)
        return int(value)
    elif isinstance(default, float) or (default is None and bounds != _ANY):
        check_number(name, value, *bounds)
        return float(value)
    # Two numbers without bounds are a list that happens to hold two.
    elif bounds != _ANY and isinstance(default, tuple) and len(default) == 2:
        check_range(name, value, *bounds)
        return float(value[0]), float(value[1])
    return value


def _check_name(name: str, value: Any, known: tuple[str, ...] | None) -> None:
    """Raise InvalidInput for what is no text, and for what is not known where names are."""
    if not isinstance(value, str):
        raise InvalidInput(f"{name} must be a name, got {shown(value)}")
    if known is not None:
        check_known(name, value, known)


def option_text(value: object) -> str:
    """A default as it is given on a command line; numbers to two decimals."""
    if isinstance(value, tuple):
        return ",".join(map(option_text, value))
    return str(round(value, 2)) if isinstance(value, float) else repr(value)
