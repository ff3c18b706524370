"""Errors a user can act on: one line that names the thing and what is allowed."""

import math
from collections.abc import Iterable
from numbers import Real

import numpy as np


class InvalidInput(ValueError):
    """A value from outside (argument, option, file) that the benchmark cannot accept."""


class BrokenPolicy(InvalidInput):
    """A policy of an installed package that cannot be loaded or made."""


class MissingExtra(ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


def unknown(kind: str, name: object, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not among the known ones."""
    return InvalidInput(f"unknown {kind} {str(name)!r}; known: {', '.join(sorted(known)) or 'none'}")


def is_number(value: object) -> bool:
    """Whether `value` is a real number, and no flag."""
    return isinstance(value, Real) and not isinstance(value, bool)


def check_number(name: str, value: object, least: float = -math.inf, most: float = math.inf) -> None:
    """Raise InvalidInput unless `value` is a finite number within `least` and `most`."""
    if not (is_number(value) and math.isfinite(value) and least <= value <= most):  # type: ignore[arg-type,operator]
        if most < math.inf:
            allowed = f"lie in [{least:g}, {most:g}]"
        else:
            allowed = f"be a finite number >= {least:g}" if least > -math.inf else "be a finite number"
        raise InvalidInput(f"{name} must {allowed}, got {value!r}")


LARGEST = 2**31 - 1
"""What a whole number may be where nothing else is said."""


def check_whole(name: str, value: object, least: int, most: int = LARGEST) -> None:
    """Raise InvalidInput unless `value` is a whole number (of an integer type) within `least` and `most`."""
    if not (isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= least):
        raise InvalidInput(f"{name} must be a whole number >= {least}, got {value!r}")
    if value > most:
        raise InvalidInput(f"{name} must be at most {most}, got {value}")
