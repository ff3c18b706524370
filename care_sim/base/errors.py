"""Errors a user can act on: one line that names the thing and what is allowed."""

import sys
from collections.abc import Iterable, Sequence

from care_sim.base.text import one_line, shown


class InvalidInput(ValueError):
    """A value from outside (argument, option, file) that the benchmark cannot accept."""


class BrokenPolicy(InvalidInput):
    """A policy of an installed package that cannot be loaded or made."""


class MissingExtra(ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


def unknown(kind: str, name: object, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not among the known ones."""
    told = shown(name if isinstance(name, str) else shown(name))
    return InvalidInput(f"unknown {kind} {told}; known: {', '.join(sorted(known)) or 'none'}")


def report_problems(problems: Sequence[str]) -> None:
    """Print them, a line each, where complaints go."""
    for problem in problems:
        print(f"care-sim: {one_line(problem)}", file=sys.stderr)
