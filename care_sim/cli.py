"""The command line `care-sim`: finds the command, runs it, and says in one line what went wrong."""

import contextlib
import gc
import io
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn

import care_sim
from care_sim.base import interrupts
from care_sim.base.causes import causes
from care_sim.base.errors import (
    LONGEST,
    InvalidInput,
    MissingExtra,
    error_line,
    is_own_fault,
    one_line,
    shortened,
    shown,
)
from care_sim.base.foreign_code import foreign_place
from care_sim.base.limits import limit_in
from care_sim.commands.entries import COMMANDS, GROUPS
from care_sim.commands.shared.hints import ways_on
from care_sim.commands.shared.parsing import chosen_command, option_helps

_FAILED = 1
_BAD_INPUT = 2
_UNEXPECTED = 70
"""The exit code of a fault in the software: `EX_SOFTWARE` of BSD."""
_UNREAD = 141
"""The exit code where nobody reads the output: what a shell gives for SIGPIPE, 128 + 13."""
_DEBUG = "--debug"

_ABOUT = (
    "Benchmark for adaptive LiDAR sensing: the closed loop, and first sightings in the open loop."
)
_USAGE = """usage: care-sim COMMAND [options]

Benchmark for adaptive LiDAR sensing: a policy decides which cells fire."""
_WAYS_ON = """care-sim COMMAND --help tells its options, --help-all the conditions, too.
care-sim --version tells the version.
Begin with: care-sim run dartout"""
_NEW_OBJECTS = 100_000
"""After how many the garbage collector looks at them; Python's default is 700."""
_NARROWEST = 20
"""Columns of a terminal for which help is laid out, at the least."""

_STUDIES = (
    "benchmark",
    "reproduce",
    "sweep",
    "ablate",
    "order",
    "firing",
    "realism",
    "faults",
    "vehicle",
    "crowding",
    "ncap",
    "r157",
    "validate",
    "protocol",
    "mechanism",
)
_AGENTS = ("train ppo", "train sac", "train recurrent-ppo")
_KEPT = {
    **dict.fromkeys(_STUDIES, "; what is finished is kept, the same command goes on from there"),
    **dict.fromkeys(
        _AGENTS, "; what is learned is kept, the same command with --resume goes on from there"
    ),
}
"""What is added to "interrupted" for commands that keep what they have finished."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    Exit codes: 0 done, 1 something failed, such as code of the user's own or a limit of the
    machine, or a policy was left out, 2 bad input, 70 a fault of the software itself, 130
    interrupted, 141 nobody reads the output any more. `--debug` shows the trace of a fault.
    """
    # A host that calls this with arguments keeps its handlers of signals and its process.
    alone = arguments is None
    given = list(sys.argv[1:] if arguments is None else arguments)
    arguments = [argument for argument in given if argument != _DEBUG]
    try:
        if alone:
            interrupts.raise_them()
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
        if not _is_interrupt(error):
            _end_with(error, trace=_DEBUG in given or bool(os.environ.get("CARE_SIM_DEBUG")))
        if alone:
            interrupts.end_in_silence()
        command = " ".join(arguments[: 2 if arguments[:1] == ["train"] else 1])
        _complain(f"interrupted{_KEPT.get(command, '')}", interrupts.INTERRUPTED)
    finally:
        if alone:
            interrupts.end_in_silence()


def _is_interrupt(error: BaseException) -> bool:
    """Whether an error is an interrupt, or what an import has made of one."""
    # A compiled module that is interrupted while it is imported raises ImportError or SystemError,
    # and keeps the interrupt as the cause.
    links = causes(error) if isinstance(error, ImportError | SystemError) else [error]
    return any(isinstance(link, KeyboardInterrupt) for link in links)


def _end_with(error: BaseException, trace: bool) -> NoReturn:
    """Say in one line what was wrong, and exit; a fault of the software is raised again where its
    trace is wanted.
    """
    # A fault in code that somebody brought is theirs to mend.
    if isinstance(error, InvalidInput | MissingExtra):
        own = is_own_fault(error)
        if own and trace:
            raise error
        _complain(str(error), _FAILED if own else _BAD_INPUT)
    if isinstance(error, BrokenPipeError):
        _leave_output()
        sys.exit(_UNREAD)
    if foreign_place(error) and not trace:
        _complain(error_line(error), _FAILED)
    if (limit := limit_in(error)) and not trace:
        _leave_output()
        _complain(limit, _FAILED)
    if isinstance(error, OSError):
        _leave_output()
        _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    if trace:
        raise error
    _complain(
        f"unexpected {error_line(error)}; please report it, with the trace that {_DEBUG} "
        "(or CARE_SIM_DEBUG=1) shows",
        _UNEXPECTED,
    )


def _settle_output() -> None:
    """Prepare standard output and error for whatever is printed."""
    # A process without a terminal may have no streams at all. What an encoding lacks is written as
    # an escape.
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
        return int(parsed_command(arguments)())
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


def parsed_command(arguments: Sequence[str]) -> Callable[[], int]:
    """The command that the arguments name, with its options. Raises InvalidInput, in one line."""
    named = arguments[0] if arguments else "--help"
    if named in _ASKED:
        return partial(_told, _ASKED[named]())
    if named in _MOVED:
        raise InvalidInput(f"`care-sim {named}` is `{_MOVED[named]}` now, in a clone")
    if named.startswith("-"):
        raise InvalidInput(
            f"{shown(named)} is no option of care-sim; `care-sim` tells the commands"
        )
    # The learners are commands of their own; their help lists them alone.
    if named == "train":
        commands, prog = COMMANDS[named].loaded(), "care-sim train"
        about, arguments = COMMANDS[named].about, arguments[1:]
    else:
        # For names that are mistyped, what the list says of each command is enough.
        commands = {name: _described(command.about) for name, command in COMMANDS.items()}
        prog, about = "care-sim", _ABOUT
        if named in COMMANDS:
            commands[named] = COMMANDS[named].loaded()
    try:
        return chosen_command(commands, prog, about, arguments)
    except InvalidInput as error:
        asked = commands.get(arguments[0]) if arguments else None
        options = option_helps(asked) if isinstance(asked, type) else {}
        raise InvalidInput(f"{error}{ways_on(str(error), options, named)}") from None


def _overview() -> str:
    """Every command in its group, a line each."""
    groups = [
        "\n".join([title, *(f"  {name:13}{each.about}" for name, each in group.items())])
        for title, group in GROUPS.items()
    ]
    return "\n\n".join([_USAGE, *groups, _WAYS_ON])


def _version() -> str:
    return f"care-sim {care_sim.__version__}"


_ASKED: dict[str, Callable[[], str]] = {
    "-h": _overview,
    "--help": _overview,
    "--version": _version,
}
"""What is printed where no command is named."""
_MOVED = {"bench": "make bench", "parity": "make parity"}
"""Commands of earlier versions that measure the software itself."""


def _told(text: str) -> int:
    print(text)
    return 0


def _described(about: str) -> Callable[..., Any]:
    """A command that does nothing, with the line that help shows of it."""

    def command() -> None: ...

    command.__doc__ = about
    return command


def _complain(message: str, code: int = _BAD_INPUT) -> NoReturn:
    with contextlib.suppress(OSError):  # the terminal may be what is gone
        print(f"care-sim: {shortened(one_line(message), LONGEST)}", file=sys.stderr)
    sys.exit(code)
