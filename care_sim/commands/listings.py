"""`care-sim policies`, `detectors`, `sensors` and `scenarios`: what can be named."""

import inspect
import shutil
import textwrap
from dataclasses import Field, dataclass, fields
from typing import Any

from care_sim.base.bounds import allowed
from care_sim.perception.detectors import detector_lines
from care_sim.policies.listing import policy_paragraphs
from care_sim.scenarios import SCENARIOS
from care_sim.scenarios.crossing import OCCLUDERS
from care_sim.scenarios.mirroring import MIRRORED
from care_sim.scenarios.ncap.scenario import DRAWN
from care_sim.scenarios.ncap.table import TESTS
from care_sim.scenarios.r157.grid import KINDS, SIDES
from care_sim.sensors.setups import setup_lines
from care_sim.streets.encounters import COMERS


@dataclass(frozen=True)
class Policies:
    """List the policies: tags, parameters, sources."""

    def __call__(self) -> int:
        """Run it."""
        print(*policy_paragraphs(), sep="\n")
        return 0


@dataclass(frozen=True)
class Detectors:
    """List the detectors."""

    def __call__(self) -> int:
        """Run it."""
        print(*map(_wrapped, detector_lines()), sep="\n")
        return 0


@dataclass(frozen=True)
class Sensors:
    """List the sensor set-ups."""

    def __call__(self) -> int:
        """Run it."""
        print(*map(_wrapped, setup_lines()), sep="\n")
        return 0


_NAMED = {
    "occluder": OCCLUDERS,
    "mirrored": MIRRORED,
    "kind": KINDS,
    "side": SIDES,
    "test": (*TESTS, DRAWN),
    "who": COMERS,
}
"""The choices of the parameters of scenarios that are names."""
_ZERO = {"speed_kph": "0 is drawn", "target_kph": "0 is the protocol's"}
"""What 0 stands for, of parameters in which it is no number."""


@dataclass(frozen=True)
class Scenarios:
    """List the scenarios and their parameters."""

    def __call__(self) -> int:
        """Run it."""
        for name, scenario in SCENARIOS.items():
            print(_wrapped(f"{name:12} {_summary(scenario)}"))
            for field in fields(scenario):
                print(_wrapped(f"    {field.name}={_rounded(field.default)}{_choices(field)}"))
            print()
        return 0


def _wrapped(line: str) -> str:
    """The line, broken at words where the terminal is narrower; what goes on is indented."""
    return textwrap.fill(
        line,
        shutil.get_terminal_size().columns,
        subsequent_indent=" " * 8,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _choices(field: Field[Any]) -> str:
    """The values that a parameter may have, and which the seed draws, in brackets; empty where
    there is nothing to tell.
    """
    named = f"of {', '.join(_NAMED[field.name])}" if field.name in _NAMED else ""
    told = (
        named or allowed(field),
        _ZERO.get(field.name, ""),
        "None is drawn" if field.default is None else "",
    )
    text = "; ".join(filter(None, told))
    return f" ({text})" if text else ""


def _summary(thing: object) -> str:
    """The first line of the docstring of a scenario's module."""
    module = inspect.getmodule(thing)
    return (inspect.getdoc(module) or "").partition("\n")[0]


def _rounded(value: object) -> str:
    """A default as it is given on a command line; numbers to two decimals."""
    if isinstance(value, tuple):
        return ",".join(map(_rounded, value))
    return str(round(value, 2)) if isinstance(value, float) else repr(value)
