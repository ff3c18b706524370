"""Checks of values from outside. Each raises one line that names the value and what is allowed.

Limits of a dataclass field stand beside its default, are checked when the dataclass is made, and
are printed by lists. The kind follows from the default: a flag, text, a whole number, a number, or,
where it is bounded, a range of numbers (low, high). A field whose default is None may stay None.
Numbers of any type become Python's own, so that equal configurations are written alike.
"""

import math
import os
from collections.abc import Container, Iterable
from dataclasses import Field, field, fields
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput, shown, unknown

LARGEST_INTEGER = 2**31 - 1
"""Default bounds of whole numbers."""
LARGEST_SEED = 2**63 - 1
"""Bounds of a column in a results file."""
LONGEST_PATH = 4095
LONGEST_NAME = 255
"""Bytes of a path and of a name in it (Linux)."""


def check_known(kind: str, name: object, known: Iterable[str]) -> None:
    """Raise InvalidInput unless `name` is one of the known ones."""
    if not (isinstance(name, str) and name in known):
        raise unknown(kind, name, known)


def check_arguments(of: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise InvalidInput for an unknown argument name; the error suggests the nearest one."""
    known = [*known]
    for name in given:
        if name not in known:
            nearest = get_close_matches(name, known, 1)
            hint = f", the nearest is {nearest[0]}" if nearest else ""
            named = ", ".join(sorted(known))
            raise InvalidInput(f"unknown argument of {of} {shown(name)}{hint}; known: {named}")


def is_number(value: object) -> bool:
    """Whether `value` is a real number, and no flag."""
    return isinstance(value, Real) and not isinstance(value, bool)


def check_number(
    name: str, value: object, least: float = -math.inf, most: float = math.inf
) -> None:
    """Raise InvalidInput unless `value` is a finite number within `least` and `most`."""
    if not (is_number(value) and least <= _finite(value) <= most):
        allowed = "be a finite number"
        if most < math.inf:
            allowed = f"lie in [{least:g}, {most:g}]"
        elif least > -math.inf:
            allowed = f"be a finite number >= {least:g}"
        raise InvalidInput(f"{name} must {allowed}, got {shown(value)}")


def _finite(value: Any) -> float:
    """The number as a float; NaN, which lies in no range, for what none is near."""
    # A whole number of Python may be larger than any float.
    try:
        number = float(value)
    except OverflowError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def check_whole(name: str, value: object, least: float, most: float = LARGEST_INTEGER) -> None:
    """Raise InvalidInput unless `value` is a whole number (of an integer type) within `least` and
    `most`.
    """
    whole = int(value) if isinstance(value, Integral) and is_number(value) else None
    if whole is None or not least <= whole <= most:
        # The common bound goes without saying, unless it is what the value breaks.
        is_told = most < LARGEST_INTEGER or (whole is not None and whole > most)
        upper = f" and <= {most}" if is_told else ""
        raise InvalidInput(f"{name} must be a whole number >= {least}{upper}, got {shown(value)}")


def check_range(name: str, value: Any, least: float = -math.inf, most: float = math.inf) -> None:
    """Raise InvalidInput unless `value` is a pair of numbers, low and high, within `least` and
    `most`.
    """
    fits = isinstance(value, tuple | list) and len(value) == 2 and all(map(is_number, value))
    if not (fits and least <= _finite(value[0]) <= _finite(value[1]) <= most):
        within = f", within [{least:g}, {most:g}]" if (least, most) != (-math.inf, math.inf) else ""
        raise InvalidInput(f"{name} must be two numbers, low and high{within}, got {shown(value)}")


def checked_place(
    name: str, value: Any, *bounds: tuple[float, float]
) -> tuple[float, float, float]:
    """x, y and z in metres as plain numbers. Raises InvalidInput for what is none, and for a number
    beyond its `bounds`: one pair for all three, or one each.
    """
    if not (isinstance(value, tuple | list | np.ndarray) and len(value) == 3):
        raise InvalidInput(f"{name} must be x, y and z in metres, got {shown(value)}")
    for axis, number, limits in zip("xyz", value, bounds * (3 // len(bounds)), strict=True):
        check_number(f"{axis} of {name}", number, *limits)
    # Zero has no sign, which equality does not tell but a hash would.
    x, y, z = (float(number) + 0.0 for number in value)
    return x, y, z


def check_flag(name: str, value: object) -> None:
    """Raise InvalidInput unless `value` is True or False."""
    if not isinstance(value, bool):
        raise InvalidInput(f"{name} must be True or False, got {shown(value)}")


def check_flags(**switches: object) -> None:
    """Raise InvalidInput unless all `switches` are True or False."""
    for name, value in switches.items():
        check_flag(name, value)


def check_seed(seed: object, name: str = "seed") -> None:
    """Raise InvalidInput for a seed that no column holds."""
    check_whole(name, seed, 0, LARGEST_SEED)


def check_path(name: str, value: object) -> None:
    """Raise InvalidInput for an impossible name of a file or folder."""
    # As bytes, for a file system counts those. A path in bytes is refused: tables hold text.
    try:
        path = b"" if isinstance(value, bytes) else os.fsencode(value)  # type: ignore[arg-type]
    except (TypeError, UnicodeError) as error:
        raise InvalidInput(f"{name} must be a path, got {shown(value)}") from error
    wrong = _wrong_path(path)
    if wrong:
        raise InvalidInput(
            f"{name} must be a path, none that is {wrong}, got {shown(os.fsdecode(path))}"
        )


def _wrong_path(path: bytes) -> str:
    """Say why a path is impossible; empty for a possible one."""
    if not path:
        return "empty"
    names = path.split(b"/")
    if len(path) > LONGEST_PATH or any(len(name) > LONGEST_NAME for name in names):
        return "longer than a file system allows"
    return "with a null character" if b"\0" in path else ""


def as_array(name: str, value: Any) -> NDArray[Any]:
    """`value` as an array. Raises InvalidInput for what has no regular shape."""
    try:
        return np.asarray(value)
    except Exception as error:  # a ragged list, and whatever foreign arrays do
        raise InvalidInput(f"{name} must be an array, got {shown(value)}") from error


def check_choice(name: str, value: object, choices: Container[object]) -> None:
    """Raise InvalidInput unless `value` is None or one of the named choices."""
    if value is not None and not (isinstance(value, str) and value in choices):
        named = " or ".join(map(repr, choices)) if isinstance(choices, Iterable) else str(choices)
        raise InvalidInput(f"{name} must be None or {named}, got {shown(value)}")


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
    # Limits of the computer alone do not help a reader.
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
