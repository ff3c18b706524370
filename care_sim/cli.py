"""The command line `care-sim`: finds the command, runs it, and says in one line what was wrong."""

import contextlib
import importlib
import inspect
import io
import os
import re
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import Field, dataclass, fields
from typing import Any, NoReturn

import tyro

from care_sim.base import interrupts
from care_sim.base.bounds import allowed
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.text import one_line, shortened, shown
from care_sim.commands.closed_loop import Ablate, Crowding, Faults, Report, Reproduce, Run, Sweep
from care_sim.commands.compare import Compare
from care_sim.commands.export import Export
from care_sim.commands.protocol import Protocol
from care_sim.commands.view import View

BAD_INPUT, UNEXPECTED, UNREAD = 2, 70, 141
"""Exit codes: that of a fault in the software is `EX_SOFTWARE` of BSD, the last that of a shell for the signal."""
DEBUG = "--debug"


@dataclass(frozen=True)
class Policies:
    """List the policies with their tags, parameters and sources."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.policies.listing import listing

        print(*listing(), sep="\n")
        return 0


@dataclass(frozen=True)
class Detectors:
    """List the detectors of the open loop."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.perception.detectors import detector_lines

        print(*detector_lines(), sep="\n")
        return 0


@dataclass(frozen=True)
class Scenarios:
    """List the scenarios and their parameters."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.scenarios import SCENARIOS
        from care_sim.scenarios.crossing import OCCLUDERS

        choices = {"occluder": f" (of {', '.join(OCCLUDERS)})"}
        for name, scenario in SCENARIOS.items():
            print(f"{name:12} {_summary(scenario)}")
            print(
                "".join(
                    f"    {field.name}={_rounded(field.default)}{choices.get(field.name) or _bounds(field)}\n"
                    for field in fields(scenario)
                )
            )
        return 0


@dataclass(frozen=True)
class Bench:
    """Measure speed: keyframe, scans, steps and memory, beside other engines and environments."""


@dataclass(frozen=True)
class Parity:
    """Hold the engine fast against Bullet: rays of random scenes and of every keyframe, pictures, whole episodes."""


@dataclass(frozen=True)
class Certify:
    """Play a published list of episodes and say whether they go as published, or where one does not."""


@dataclass(frozen=True)
class Train:
    """Train a learned policy on an environment: `care-sim train --help` lists the learners."""


ABOUT = "Benchmark for adaptive LiDAR sensing: the closed loop, and first sightings in the open loop."
LONGEST, NARROWEST = 2000, 20
"""Characters of a complaint, and of a line of help at the least."""
COMMANDS: dict[str, Callable[..., Any]] = {
    "reproduce": Reproduce,
    "run": Run,
    "compare": Compare,
    "view": View,
    "sweep": Sweep,
    "ablate": Ablate,
    "faults": Faults,
    "crowding": Crowding,
    "protocol": Protocol,
    "report": Report,
    "export": Export,
    "policies": Policies,
    "detectors": Detectors,
    "scenarios": Scenarios,
    "bench": Bench,
    "parity": Parity,
    "certify": Certify,
    "train": Train,
}

MEASURES = {"bench": "BenchConfig", "parity": "ParityConfig", "certify": "CertifyConfig"}
"""Commands of packages that are imported for them alone, and what they are told in."""
STUDIES = ("reproduce", "sweep", "ablate", "faults", "crowding", "protocol")
KEPT = dict.fromkeys(STUDIES, "; what is finished is kept, the same command goes on from there")
LEARNERS = ("ppo", "sac", "recurrent-ppo")
KEPT |= dict.fromkeys(
    (f"train {name}" for name in LEARNERS),
    "; what is learned is kept, the same command with --resume goes on from there",
)
"""What commands that keep what they have finished say when they are interrupted."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    0 done, 1 something failed or a policy was left out, 2 bad input, 70 a fault of the software itself, whose trace
    `--debug` shows, 130 interrupted, 141 nobody reads the output any more.
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
        link = link.__cause__ or link.__context__ if isinstance(error, ImportError | SystemError) else None
    return link is not None


def _end_with(error: BaseException, trace: bool) -> NoReturn:
    """Say in one line what was wrong, and exit; a fault of the software is raised again where its trace is wanted."""
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
    _complain(f"{told}; please report it, with the trace that {DEBUG} (or CARE_SIM_DEBUG=1) shows", UNEXPECTED)


def _settle_output() -> None:
    """Let output go nowhere where there is none. Write what an encoding lacks as an escape. Take a terminal of few
    columns, for which tyro never ends its help, for one of NARROWEST.
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
        return _command(arguments)
    finally:
        sys.stdout.flush()


def _check_texts(arguments: list[str]) -> None:
    """Raise InvalidInput for an argument that says nothing, or that no shell can give."""
    for argument in arguments:
        if not argument or (argument.startswith("--") and argument.endswith("=") and argument.count("=") == 1):
            raise InvalidInput(f"an argument is empty: {' '.join(arguments)}")
        try:
            whole = b"\0" not in os.fsencode(argument)
        except UnicodeError:
            whole = False
        if not whole:
            raise InvalidInput(f"no text: {shown(argument)}")


def _command(arguments: list[str]) -> int:
    if arguments and arguments[0] in MEASURES:
        return _measure(*arguments)
    if arguments[:1] == ["train"]:
        commands = importlib.import_module("care_sim.commands.train").LEARNERS
        return _chosen_of(commands, "care-sim train", Train.__doc__, arguments[1:])
    return _chosen_of(COMMANDS, "care-sim", ABOUT, arguments)


def _chosen_of(commands: dict[str, Callable[..., Any]], prog: str, about: str | None, arguments: list[str]) -> int:
    """Run the command that the arguments name."""
    command = _in_one_line(
        lambda: tyro.extras.subcommand_cli_from_dict(commands, prog=prog, description=about, args=arguments)
    )
    return int(command())


def _measure(name: str, *options: str) -> int:
    config, run = (importlib.import_module(f"care_sim.measure.{name}.{part}") for part in ("config", "run"))
    parsed = _in_one_line(lambda: tyro.cli(getattr(config, MEASURES[name]), args=options, prog=f"care-sim {name}"))
    return int(run.run(parsed))


def _in_one_line(parse: Callable[[], Any]) -> Any:
    """Parse the command line with tyro; help is printed as tyro does, a mistake becomes one line."""
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return parse()
    except SystemExit as end:
        if end.code in (0, None):
            raise
        if refusal := _refusal(end):
            raise refusal from None
    raise InvalidInput(_one_line(complaint.getvalue()))


def _refusal(end: BaseException | None) -> InvalidInput | None:
    """What an options' class refused, of which tyro makes a mistake of its own."""
    while end is not None and not isinstance(end, InvalidInput):
        end = end.__cause__ or end.__context__
    return end


def _one_line(box: str) -> str:
    """The message that tyro draws as a box: sections between rules, without title, second guesses and help."""
    lines = [line.strip(" │╭╮╰╯|+") for line in box.splitlines()][1:]
    sections = re.sub("─+|-{5,}", "\n", " ".join(lines)).splitlines()
    texts = [" ".join(section.split()).partition(" in care-sim ")[0] for section in sections]
    return "; ".join(text.rstrip(".") for text in texts if text and not text.startswith("For full helptext"))


def _bounds(field: Field[Any]) -> str:
    return f" ({allowed(field)})" if allowed(field) else ""


def _summary(thing: object) -> str:
    """The line that the module of a scenario begins with."""
    module = inspect.getmodule(thing)
    return (inspect.getdoc(module) or "").partition("\n")[0]


def _rounded(value: object) -> str:
    """A default as a shell takes it; numbers to two decimals."""
    if isinstance(value, tuple):
        return ",".join(map(_rounded, value))
    return str(round(value, 2)) if isinstance(value, float) else repr(value)


def _complain(message: str, code: int = BAD_INPUT) -> NoReturn:
    with contextlib.suppress(OSError):  # the terminal may be what is gone
        print(f"care-sim: {shortened(one_line(message), LONGEST)}", file=sys.stderr)
    sys.exit(code)
