"""The command line `care-sim`: finds the command, runs it, and says in one line what was wrong."""

import contextlib
import importlib
import inspect
import io
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, NoReturn

import tyro

from care_sim.errors import InvalidInput, MissingExtra
from care_sim.study.commands import Ablate, Crowding, Faults, Report, Reproduce, Run, Sweep
from care_sim.study.compare import Compare
from care_sim.study.export import Export
from care_sim.study.protocol import Protocol
from care_sim.viewer.command import View

BAD_INPUT, INTERRUPTED = 2, 130


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
        from care_sim.perception.registry import listing

        print(*listing(), sep="\n")
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
                    f"    {field.name}={_rounded(field.default)}{choices.get(field.name, '')}\n"
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

    0 done, 1 something failed or a policy was left out, 2 bad input, 130 interrupted.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        sys.exit(_command(arguments))
    except (InvalidInput, MissingExtra) as error:
        _complain(str(error))
    except OSError as error:
        _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except KeyboardInterrupt:
        words = 2 if arguments[:1] == ["train"] else 1
        _complain(f"interrupted{KEPT.get(' '.join(arguments[:words]), '')}", INTERRUPTED)


def _command(arguments: list[str]) -> int:
    if arguments and arguments[0] in MEASURES:
        return _measure(*arguments)
    if arguments[:1] == ["train"]:
        commands = importlib.import_module("care_sim.training").COMMANDS
        return _chosen_of(commands, "care-sim train", Train.__doc__, arguments[1:])
    return _chosen_of(COMMANDS, "care-sim", ABOUT, arguments)


def _chosen_of(commands: dict[str, Callable[..., Any]], prog: str, about: str | None, arguments: list[str]) -> int:
    """Run the command that the arguments name."""
    command = _in_one_line(
        lambda: tyro.extras.subcommand_cli_from_dict(commands, prog=prog, description=about, args=arguments)
    )
    return int(command())


def _measure(name: str, *options: str) -> int:
    config, run = (importlib.import_module(f"care_sim.{name}.{part}") for part in ("config", "run"))
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
    raise InvalidInput(_one_line(complaint.getvalue()))


def _one_line(box: str) -> str:
    """The message that tyro draws as a box: sections between rules, without title, second guesses and help."""
    lines = [line.strip(" │╭╮╰╯") for line in box.splitlines()][1:]
    sections = " ".join(lines).replace("─" * 3, "\n").replace("─", "").splitlines()
    texts = [" ".join(section.split()).partition(" in care-sim ")[0] for section in sections]
    return "; ".join(text.rstrip(".") for text in texts if text and not text.startswith("For full helptext"))


def _summary(thing: object) -> str:
    """The line that the module of a scenario begins with."""
    module = inspect.getmodule(thing)
    return (inspect.getdoc(module) or "").partition("\n")[0]


def _rounded(value: object) -> str:
    """A default as people write it; numbers to two decimals."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_rounded, value))})"
    return str(round(value, 2)) if isinstance(value, float) else repr(value)


def _complain(message: str, code: int = BAD_INPUT) -> NoReturn:
    print(f"care-sim: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)
