"""The command line `care-sim`: finds the command, runs it, and says in one line what was wrong."""

import contextlib
import importlib
import io
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn

from care_sim.base import interrupts
from care_sim.base.errors import InvalidInput, MissingExtra, one_line, shortened, shown
from care_sim.commands.shared.parsing import chosen_command

BAD_INPUT, UNEXPECTED, UNREAD = 2, 70, 141
"""Exit codes: that of a fault in the software is `EX_SOFTWARE` of BSD, the last that of a shell for
the signal.
"""
DEBUG = "--debug"


ABOUT = (
    "Benchmark for adaptive LiDAR sensing: the closed loop, and first sightings in the open loop."
)
LONGEST, NARROWEST = 2000, 20
"""Characters of a complaint, and of a line of help at the least."""


class CommandEntry(NamedTuple):
    """Where a command is, and what `care-sim --help` says of it."""

    module: str
    name: str
    about: str

    def loaded(self) -> Any:
        """The dataclass of its options, whose call runs it; or a table of several by name.

        Only the command that is asked for is imported, and here alone: what plays, draws or learns
        takes seconds to import, which `care-sim --help` and a mistyped name need not wait for.
        """
        return getattr(importlib.import_module(f"care_sim.commands.{self.module}"), self.name)


COMMANDS = {
    "reproduce": CommandEntry(
        "reproduce",
        "Reproduce",
        "Play the paper's closed-loop study, 49 configurations per seed, and print it beside "
        "the paper's figures.",
    ),
    "run": CommandEntry(
        "run",
        "Run",
        "Play one episode and print its timeline and outcome.",
    ),
    "compare": CommandEntry(
        "compare",
        "Compare",
        "Play the same seed under several policies and print their outcomes side by side.",
    ),
    "view": CommandEntry(
        "view",
        "View",
        "Open a recording of `run --record` or `compare --record` in the Rerun viewer (extra "
        "'viewer').",
    ),
    "sweep": CommandEntry(
        "sweep",
        "Sweep",
        "Play every combination of scenarios, policies, budgets, faults and seeds.",
    ),
    "ablate": CommandEntry(
        "ablate",
        "Ablate",
        "Vary one thing at a time as the paper's ablations do, 162 configurations per seed, "
        "one table per thing varied.",
    ),
    "faults": CommandEntry(
        "faults",
        "Faults",
        "Let every fault grow and find where the order of the policies changes, 318 "
        "configurations per seed.",
    ),
    "crowding": CommandEntry(
        "crowding",
        "Crowding",
        "Find where the all-camera reserve collapses as vehicles fill the dense street, 221 "
        "configurations per seed.",
    ),
    "protocol": CommandEntry(
        "protocol",
        "Protocol",
        "Play the paper's first-sighting protocol: every policy over the same keyframes, on "
        "streets or recordings.",
    ),
    "report": CommandEntry(
        "report",
        "Report",
        "Print the tables of a folder of results and draw its figures again, or make one web "
        "page of it all.",
    ),
    "export": CommandEntry(
        "export",
        "Export",
        "Play a policy over nuScenes scenes and write its detections in the results form of the "
        "official devkit.",
    ),
    "policies": CommandEntry(
        "listings",
        "Policies",
        "List the policies with their tags, parameters and sources.",
    ),
    "detectors": CommandEntry(
        "listings",
        "Detectors",
        "List the detectors of the open loop.",
    ),
    "scenarios": CommandEntry(
        "listings",
        "Scenarios",
        "List the scenarios and their parameters.",
    ),
    "bench": CommandEntry(
        "bench",
        "Bench",
        "Measure speed: keyframe, scans, steps and memory, beside other engines and environments.",
    ),
    "parity": CommandEntry(
        "parity",
        "Parity",
        "Compare the engine `fast` with Bullet: rays of random scenes and of every keyframe, "
        "pictures, whole episodes.",
    ),
    "certify": CommandEntry(
        "certify",
        "Certify",
        "Play a published list of episodes and say whether they go as published, or where one "
        "does not.",
    ),
    "train": CommandEntry(
        "train",
        "LEARNERS",
        "Train a learned policy on an environment: `care-sim train --help` lists the learners.",
    ),
}

STUDIES = ("reproduce", "sweep", "ablate", "faults", "crowding", "protocol")
KEPT = dict.fromkeys(STUDIES, "; what is finished is kept, the same command goes on from there")
AGENTS = ("ppo", "sac", "recurrent-ppo")
KEPT |= dict.fromkeys(
    (f"train {name}" for name in AGENTS),
    "; what is learned is kept, the same command with --resume goes on from there",
)
"""What commands that keep what they have finished say when they are interrupted."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    0 done, 1 something failed or a policy was left out, 2 bad input, 70 a fault of the software
    itself, whose trace `--debug` shows, 130 interrupted, 141 nobody reads the output any more.
    """
    alone = arguments is None
    given = list(sys.argv[1:] if arguments is None else arguments)
    arguments = [argument for argument in given if argument != DEBUG]
    try:
        if alone:
            interrupts.raise_them()
        _settle_output()
        sys.exit(_finished(arguments))
    except (KeyboardInterrupt, Exception) as error:
        if not _is_interrupt(error):
            _end_with(error, trace=DEBUG in given or bool(os.environ.get("CARE_SIM_DEBUG")))
        if alone:
            interrupts.end_in_silence()
        words = 2 if arguments[:1] == ["train"] else 1
        _complain(f"interrupted{KEPT.get(' '.join(arguments[:words]), '')}", interrupts.INTERRUPTED)
    finally:
        if alone:
            interrupts.end_in_silence()


def _is_interrupt(error: BaseException) -> bool:
    """Whether it is one, or what an import has made of one."""
    link: BaseException | None = error
    while link is not None and not isinstance(link, KeyboardInterrupt):
        link = (
            link.__cause__ or link.__context__
            if isinstance(error, ImportError | SystemError)
            else None
        )
    return link is not None


def _end_with(error: BaseException, trace: bool) -> NoReturn:
    """Say in one line what was wrong, and exit; a fault of the software is raised again where its
    trace is wanted.
    """
    if isinstance(error, InvalidInput | MissingExtra):
        _complain(str(error))
    if isinstance(error, BrokenPipeError):
        _leave_output()
        sys.exit(UNREAD)
    if isinstance(error, OSError):
        _leave_output()
        _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    if trace:
        raise error
    told = f"unexpected {type(error).__name__}: {error}"
    _complain(
        f"{told}; please report it, with the trace that {DEBUG} (or CARE_SIM_DEBUG=1) shows",
        UNEXPECTED,
    )


def _settle_output() -> None:
    """Let output go nowhere where there is none. Write what an encoding lacks as an escape. Take a
    terminal of few columns, for which tyro never ends its help, for one of NARROWEST.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115 (as long as the process)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)


def _leave_output() -> None:
    """Let what cannot be written any more go nowhere, or Python would complain of it at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _finished(arguments: list[str]) -> int:
    """Run the command, and write all that it has printed."""
    _check_texts(arguments)
    try:
        return int(parsed(arguments)())
    finally:
        sys.stdout.flush()


def _check_texts(arguments: list[str]) -> None:
    """Raise InvalidInput for an argument that says nothing, or that no shell can give."""
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


def parsed(arguments: Sequence[str]) -> Callable[[], int]:
    """The command that the arguments name, with its options. Raises InvalidInput, in one line."""
    named = arguments[0] if arguments else ""
    if named == "train":
        train = COMMANDS[named]
        return chosen_command(train.loaded(), "care-sim train", train.about, arguments[1:])
    commands = {name: _described(command.about) for name, command in COMMANDS.items()}
    if named in COMMANDS:
        commands[named] = COMMANDS[named].loaded()
    return chosen_command(commands, "care-sim", ABOUT, arguments)


def _described(about: str) -> Callable[..., Any]:
    """What stands in the list of commands for one that is not asked for."""

    def command() -> None: ...

    command.__doc__ = about
    return command


def _complain(message: str, code: int = BAD_INPUT) -> NoReturn:
    with contextlib.suppress(OSError):  # the terminal may be what is gone
        print(f"care-sim: {shortened(one_line(message), LONGEST)}", file=sys.stderr)
    sys.exit(code)
