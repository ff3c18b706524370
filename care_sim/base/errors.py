"""Errors of one line that name the thing and what is allowed, and text made fit to be shown."""

import inspect
import site
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from importlib.metadata import entry_points
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import TextIO

_OURS = Path(__file__).parent.parent
_FOLDERS = (
    *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")),
    # A system's own packages and those of `pip install --user` lie elsewhere.
    *site.getsitepackages(),
    site.getusersitepackages(),
)
_LIBRARIES = [Path(folder) for folder in dict.fromkeys(_FOLDERS)]


def foreign_place(error: BaseException) -> str:
    """Return " (file and line)" where an error left foreign code, else an empty text. Foreign code
    is a user's own, or a package that adds something to the benchmark.
    """
    # The innermost one: what it calls is ours or a library's, and was called wrongly.
    return next((_place(*at) for at in _frames(error) if _is_foreign(at[0])), "")


def is_raised_by_foreign(error: BaseException) -> bool:
    """Whether foreign code raised an error itself, not what it called."""
    return any(_is_foreign(frame) for frame, _ in _frames(error)[:1])


def _frames(error: BaseException) -> list[tuple[FrameType, int]]:
    """The frames and lines that an error came through, the innermost first."""
    return [*walk_tb(error.__traceback__)][::-1]


def _place(frame: FrameType, line: int) -> str:
    return f" ({Path(frame.f_code.co_filename).name}, line {line})"


def class_place(kind: type) -> str:
    """Return " (file and line)" of a class; empty where it has no file."""
    try:
        _, line = inspect.getsourcelines(kind)
        return f" (class {kind.__name__}, {Path(inspect.getfile(kind)).name}, line {line})"
    except (OSError, TypeError):
        return ""


def _is_foreign(frame: FrameType) -> bool:
    """Return True for code of neither the benchmark nor a library that adds nothing to it."""
    file = Path(frame.f_code.co_filename)
    # Code that Python itself makes, such as the methods of dataclasses, has a file name in
    # brackets.
    if not file.is_absolute() or file.is_relative_to(_OURS):
        return False
    if not any(map(file.is_relative_to, _LIBRARIES)):
        return True
    return _top(frame.f_globals.get("__name__", "")) in _plugged_in()


def _plugged_in() -> set[str]:
    """The top-level modules of packages that add something."""
    try:
        installed = entry_points()
    except (OSError, MemoryError):  # the error at hand may be of a limit that holds here, too
        return set()
    return {
        _top(entry.module)
        for group in installed.groups
        if group.startswith("care_sim.")
        for entry in installed.select(group=group)
    }


def _top(module: str) -> str:
    return module.partition(".")[0]


_QUOTED = 120
"""Characters of a value that a message quotes."""
_MOST_NAMES = 80
"""Known names that a message lists. A longer list shows the first, the last and the count."""
LONGEST = 2000
"""Characters of a complaint, at the most."""
_SAID = 300
"""Characters that a message quotes of an error."""
_LISTINGS = {
    "command": "care-sim",
    "policy": "care-sim list policies",
    "scenario": "care-sim list scenarios",
    "source": "care-sim list sources",
    "detector": "care-sim list detectors",
}
"""The commands that list things of a kind."""


class InvalidInput(ValueError):
    """A value from outside (argument, option, file) that the benchmark cannot accept."""


class BrokenPolicy(InvalidInput):
    """A policy of an installed package that cannot be loaded or made."""


class BrokenScenario(InvalidInput):
    """A scenario of an installed package that cannot be loaded, made or built."""


class BrokenSource(InvalidInput):
    """A user's source whose code fails, or returns something that cannot be played."""


class MissingExtra(ImportError):
    """An optional dependency that is not installed; the message names the extra to install."""


def unknown(kind: str, name: object, known: Iterable[str], hint: str = "") -> InvalidInput:
    """Return the error for an unknown name. The error gives a `hint`, the nearest name, all names,
    and the command that lists them.
    """
    names = sorted(known)
    told = [f"unknown {kind} {shown(name if isinstance(name, str) else shown(name))}"]
    if hint:
        told.append(hint)
    if isinstance(name, str) and (nearest := get_close_matches(name, names, 1)):
        told.append(f"the nearest is {nearest[0]}")
    told.append(f"known: {_listed(names)}")
    if kind in _LISTINGS:
        told.append(f"`{_LISTINGS[kind]}` tells what each is")
    return InvalidInput("; ".join(told))


def _listed(names: Sequence[str]) -> str:
    if len(names) > _MOST_NAMES:
        return f"{names[0]} to {names[-1]}, {len(names)} in all"
    return ", ".join(names) or "none"


def print_lines(*lines: str, file: TextIO | None = None) -> None:
    """Print texts to `file` or standard output at once, each on a line of its own and `printable`,
    as anybody may have named a folder.
    """
    print(*map(printable, lines), sep="\n", file=file, flush=True)


def report_problems(problems: Sequence[str]) -> None:
    """Print problems to standard error, one per line."""
    for problem in problems:
        # In one write: workers print at once.
        print(f"care-sim: {one_line(problem)}\n", end="", file=sys.stderr)


def error_line(error: BaseException) -> str:
    """Return the type of an error and the start of its text on one line, with file and line of the
    foreign code that raised it.
    """
    told = one_line(f"{type(error).__name__}: {_text(error)}").removesuffix(":")
    return told + foreign_place(error)


def failure_line(error: BaseException) -> str:
    """Return on one line why a play failed: the text of bad input, else the error with file and
    line.
    """
    if isinstance(error, InvalidInput):
        return shortened(one_line(_text(error, LONGEST)), LONGEST)
    raised = [] if foreign_place(error) else _frames(error)[:1]
    return error_line(error) + "".join(_place(*at) for at in raised)


def _text(error: BaseException, most: int = _SAID) -> str:
    """The first `most` characters of what an error says."""
    try:
        text = str(error)
    except Exception:  # An error of foreign code may fail in its own `__str__`.
        return "its text cannot be read"
    return text if len(text) <= most else f"{text[:most]}..."


def is_own_fault(error: BaseException) -> bool:
    """Return True if the user's own code failed, False if its input was bad. The failure is among
    the error's causes.
    """
    if isinstance(error, BrokenSource):
        return True
    link: BaseException | None = error
    while link is not None:
        # Anything that foreign code itself refuses is bad input.
        if isinstance(link, InvalidInput) and is_raised_by_foreign(link):
            return False
        # A scenario's parameters are checked before it is built: what is refused then, it did.
        counts = isinstance(error, BrokenScenario) or not isinstance(link, InvalidInput)
        if counts and (isinstance(link, SyntaxError) or foreign_place(link)):
            return True
        link = link.__cause__
    return False


def shown(value: object) -> str:
    """A value as a message quotes it: on one line, its middle left out where it is long."""
    try:
        text = one_line(repr(value))
    except Exception:  # whatever a foreign object does; an int of 4,300 digits refuses, too
        text = f"a value of type {type(value).__name__}"
    return shortened(text, _QUOTED)


def shortened(text: str, most: int) -> str:
    """The text, its middle left out where it is longer than `most` characters."""
    # Three dots and the last 17 characters: what tells two long paths apart is often their end.
    return text if len(text) <= most else f"{text[: most - 20]}...{text[-17:]}"


def one_line(text: str) -> str:
    """Return the text on one line, with invisible characters as escapes."""
    return printable(" ".join(text.split()))


def printable(text: str) -> str:
    """Return the text with control codes, directions and halves of characters as escapes."""
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text
    )


def printable_lines(text: str) -> str:
    """Return a text whose lines are each `printable`."""
    return "\n".join(map(printable, text.split("\n")))


def percent(budget: float) -> str:
    """Return a budget as a percentage."""
    return f"{100 * budget:.3g}%"


def counted(count: int, unit: str) -> str:
    """Return a number of things in words."""
    return f"{count:,} {unit}{'' if count == 1 else 's'}"
