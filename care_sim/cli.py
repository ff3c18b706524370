"""The command line `care-sim`: finds the command, runs it, and says in one line what went wrong."""

import contextlib
import gc
import io
import os
import shutil
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, NoReturn

import care_sim
from care_sim.base import interrupts
from care_sim.base.errors import (
    LONGEST,
    InvalidInput,
    MissingExtra,
    error_line,
    foreign_place,
    is_own_fault,
    one_line,
    report_problems,
    shortened,
    shown,
    unknown,
)
from care_sim.base.interrupts import BAD_INPUT, FAILED, INTERRUPTED, UNEXPECTED, UNREAD
from care_sim.base.limits import is_interrupt, limit_in
from care_sim.commands.table import COMMANDS, FAMILIES, GROUPS, MOVED, RENAMED, Command

_DEBUG = "--debug"

_USAGE = """usage: care-sim COMMAND [options]

Benchmark for adaptive LiDAR sensing: a policy decides which cells fire."""
_WAYS_ON = """care-sim COMMAND --help lists its options, --help-all the conditions, too.
care-sim --version prints the version, --tyro-print-completion SHELL a script
by which bash, zsh or fish completes. Begin with: care-sim run dartout"""
_COMPLETION = "--tyro-print-completion"
_SHELLS = ("bash", "zsh", "fish")
_NEW_OBJECTS = 100_000
"""After how many the garbage collector looks at them; Python's default is 700."""
_NARROWEST = 20
"""Columns of a terminal for which help is laid out, at the least."""

_FINISHED_STAYS = "; what is finished is kept, the same command resumes"
_LEARNED_STAYS = "; what is learned is kept, the same command with --resume resumes"
_KEPT = {
    **dict.fromkeys(("benchmark", *GROUPS["Studies"]), _FINISHED_STAYS),
    **dict.fromkeys(("train ppo", "train sac", "train recurrent-ppo"), _LEARNED_STAYS),
}
"""Appended to "interrupted" for commands that keep finished work."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    Exit codes: 0 done, 1 a failure or a policy left out, 2 bad input, 70 a fault of the software,
    130 interrupted, 141 nobody reads the output. A failure is an error of the user's own code, or a
    limit of the machine. `--debug` shows the trace of a fault.
    """
    # A host that calls this with arguments keeps its handlers of signals and its process.
    alone = arguments is None
    given = list(sys.argv[1:] if arguments is None else arguments)
    arguments = [argument for argument in given if argument != _DEBUG]
    try:
        if alone:
            interrupts.raise_interrupts()
            # Modules, compiled code and rows live to the end: a collector that walks them all every
            # few thousand new objects takes a seventh of the time of a report.
            gc.set_threshold(_NEW_OBJECTS)
        _settle_output()
        # An unknown backend would end the import of Matplotlib. An unknown value of its settings
        # would end the import of Rerun. Figures and recordings depend on neither.
        for name in [name for name in os.environ if name.startswith(("MPLBACKEND", "RERUN"))]:
            del os.environ[name]
        sys.exit(_finished(arguments))
    except SystemExit:
        raise
    # Foreign code may raise anything.
    except BaseException as error:
        if not is_interrupt(error):
            _end_with(error, trace=_DEBUG in given or bool(os.environ.get("CARE_SIM_DEBUG")))
        if alone:
            interrupts.end_in_silence()
            # Finalisers of objects that the interrupt left half made would complain.
            sys.unraisablehook = lambda _: None
        names = _named([*RENAMED.get(arguments[0], "").split(), *arguments] if arguments else [])
        kept = next((_KEPT[name] for name in names if name in _KEPT), "")
        _complain(f"interrupted{kept}", INTERRUPTED)
    finally:
        if alone:
            interrupts.end_in_silence()


def _end_with(error: BaseException, trace: bool) -> NoReturn:
    """Say in one line what was wrong, and exit; a fault of the software is raised again where its
    trace is wanted.
    """
    # A fault in code that somebody brought is theirs to mend.
    if isinstance(error, InvalidInput | MissingExtra):
        own = is_own_fault(error)
        if own and trace:
            raise error
        _complain(str(error), FAILED if own else BAD_INPUT)
    if isinstance(error, BrokenPipeError):
        _leave_output()
        sys.exit(UNREAD)
    if foreign_place(error) and not trace:
        _complain(error_line(error), FAILED)
    if (limit := limit_in(error)) and not trace:
        _leave_output()
        _complain(limit, FAILED)
    if isinstance(error, OSError):
        _leave_output()
        _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    if trace:
        raise error
    _complain(
        f"unexpected {error_line(error)}; please report it, with the trace that {_DEBUG} "
        "(or CARE_SIM_DEBUG=1) shows",
        UNEXPECTED,
    )


def _settle_output() -> None:
    """Prepare standard output and error for whatever is printed."""
    # A process without a terminal may have no streams at all. Characters that an encoding lacks are
    # written as escapes.
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115 (as long as the process)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    # tyro never ends its help for a terminal of very few columns. rich fails where COLUMNS or LINES
    # is 0 or no number, and `shutil` passes over such values.
    size = shutil.get_terminal_size()
    if "COLUMNS" in os.environ or size.columns < _NARROWEST:
        os.environ["COLUMNS"] = str(max(size.columns, _NARROWEST))
    if "LINES" in os.environ:
        os.environ["LINES"] = str(size.lines)


def _leave_output() -> None:
    """Drop what cannot be written any more."""
    # Python flushes at its end, and would complain of it then.
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _finished(arguments: list[str]) -> int:
    """Run the command and write out all that it printed; returns its exit code."""
    _check_texts(arguments)
    try:
        first = arguments[0] if arguments else "--help"
        if (text := _static_text(first, arguments[1:])) is not None:
            print(text)
            return 0
        command, options = parsed_command(arguments)
        return int(command.function()(options))
    finally:
        sys.stdout.flush()


def _check_texts(arguments: list[str]) -> None:
    """Raise InvalidInput for an argument that is empty, or that no shell can give."""
    for argument in arguments:
        if not argument or (
            argument.startswith("--") and argument.endswith("=") and argument.count("=") == 1
        ):
            raise InvalidInput(f"an argument is empty: {' '.join(arguments)}")
        try:
            whole = b"\0" not in os.fsencode(argument)
        except UnicodeError:
            whole = False
        if not whole:
            raise InvalidInput(f"no text: {shown(argument)}")


def parsed_command(arguments: Sequence[str]) -> tuple[Command, Any]:
    """The command that the arguments name, and its options. Raises InvalidInput, in one line."""
    # Imported here because tyro takes a third of the time of `care-sim --help`.
    from care_sim.commands.parsing import print_completion, read_options

    arguments = _renamed(arguments)
    if arguments[0] == _COMPLETION:
        if arguments[1:] not in [[shell] for shell in _SHELLS]:
            raise InvalidInput(f"{_COMPLETION} takes one of {', '.join(_SHELLS)}")
        print_completion(arguments)
    name, rest = _chosen(arguments)
    command = COMMANDS[name]
    return command, read_options(command.options_class(), f"care-sim {name}", rest)


def _static_text(first: str, rest: Sequence[str]) -> str | None:
    """Return the text that is printed where no command runs; None where one does."""
    if first in ("-h", "--help"):
        return _overview()
    if first == "--version":
        return f"care-sim {care_sim.__version__}"
    if first in FAMILIES and rest[:1] in ([], ["-h"], ["--help"]):
        return _family(first)
    return None


def _chosen(arguments: Sequence[str]) -> tuple[str, Sequence[str]]:
    """The name of the command that the arguments name, and the words after it. Raises InvalidInput
    for another name.
    """
    first = arguments[0]
    if first.startswith("-"):
        raise InvalidInput(f"{shown(first)} is no option of care-sim; `care-sim` lists commands")
    for count, name in enumerate(_named(arguments), 1):
        if name in COMMANDS:
            return name, arguments[count:]
    if first in MOVED:
        raise InvalidInput(f"`care-sim {first}` is `{MOVED[first]}` now, in a clone")
    if first in FAMILIES:
        below = [name.split()[1] for name in COMMANDS if name.startswith(f"{first} ")]
        raise unknown(f"command after {first}", arguments[1], below)
    names = {*FAMILIES, *(name.split()[0] for name in COMMANDS)}
    old = get_close_matches(first, RENAMED, 1)
    raise unknown("command", first, names, f"perhaps `{RENAMED[old[0]]}`" if old else "")


def _renamed(arguments: Sequence[str]) -> Sequence[str]:
    """The arguments with what an old name is now, which a line says."""
    first, second = *arguments[:2], *[""] * (2 - len(arguments[:2]))
    # `export` had one form, which began with its options.
    old_export = first == "export" and second.startswith("-")
    now = "export nuscenes" if old_export else RENAMED.get(first)
    if now is None:
        return arguments
    # One folder would be reported, and its tables written anew.
    if first == "merge" and len(arguments) == 2 and not second.startswith("-"):
        raise InvalidInput("merge needs two folders at least: care-sim report FOLDER FOLDER")
    report_problems([f"`care-sim {first}` is now `care-sim {now}`"])
    return [*now.split(), *arguments[1:]]


def _named(arguments: Sequence[str]) -> list[str]:
    """The commands that the first word, and the first two, may mean."""
    words = [word.replace("_", "-") for word in arguments[:2]]
    return [" ".join(words[:count]) for count in range(1, len(words) + 1)]


def _overview() -> str:
    """Every command in its group, a line each."""
    groups = []
    for title, group in GROUPS.items():
        abouts = {name.split()[0]: command.about for name, command in group.items()}
        lines = [f"  {name:13}{FAMILIES.get(name, about)}" for name, about in abouts.items()]
        groups.append("\n".join([title, *lines]))
    return "\n\n".join([_USAGE, *groups, _WAYS_ON])


def _family(first: str) -> str:
    """Every command behind a first word, a line each."""
    own = {name: each for name, each in COMMANDS.items() if name.startswith(f"{first} ")}
    lines = [f"  {name.split()[1]:16}{command.about}" for name, command in own.items()]
    return "\n".join([f"usage: care-sim {first} NAME [options]", "", *lines])


def _complain(message: str, code: int = BAD_INPUT) -> NoReturn:
    with contextlib.suppress(OSError):  # the terminal may be what is gone
        print(f"care-sim: {shortened(one_line(message), LONGEST)}", file=sys.stderr)
    sys.exit(code)
