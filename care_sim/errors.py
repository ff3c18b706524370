"""Errors a user can act on: one line that names the thing and what is allowed."""

from collections.abc import Iterable


class InvalidInput(ValueError):
    """A value from outside (argument, option, file) that the benchmark cannot accept."""


class MissingExtra(ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


def unknown(kind: str, name: object, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not among the known ones."""
    return InvalidInput(f"unknown {kind} {str(name)!r}; known: {', '.join(sorted(known)) or 'none'}")


def check_rate(name: str, value: float) -> None:
    """Raise InvalidInput unless `value` lies in [0, 1]."""
    if not 0.0 <= value <= 1.0:
        raise InvalidInput(f"{name} must lie in [0, 1], got {value}")
