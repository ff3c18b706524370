"""`care-sim list`: what can be named."""

import inspect
import shutil
import textwrap
from collections.abc import Callable
from dataclasses import Field, fields
from typing import Any

from care_sim.base.bounds import allowed
from care_sim.base.errors import InvalidInput, printable
from care_sim.base.plugins import package_of
from care_sim.base.scenario_names import is_environment_id
from care_sim.commands.options.watching import List
from care_sim.perception.detectors import detector_lines
from care_sim.policies.listing import policy_paragraphs
from care_sim.scenarios import PLUGINS, SCENARIOS, scenario_class, scenario_names
from care_sim.scenarios.base import Scenario
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.setups import setup_lines
from care_sim.sources.installed import SOURCES
from care_sim.sources.recordings import Recordings
from care_sim.training.agents import shipped_agents


def show(options: List) -> int:
    """Print the list."""
    _LISTS[options.kind]()
    return 0


def _print_policies() -> None:
    print(*policy_paragraphs(), sep="\n")


def _print_agents() -> None:
    for agent in shipped_agents():
        policy, *told = agent.columns.items()
        print(policy[1], *(f"    {name}: {value}" for name, value in told if value), sep="\n")


def _print_scenarios() -> None:
    for name in scenario_names():
        print(*map(_wrapped, map(printable, _scenario_lines(name))), "", sep="\n")
    for _, reason in PLUGINS.refusals():
        print(_wrapped(printable(reason)))


def _print_sources() -> None:
    for name in SOURCES.names():
        print(*map(_wrapped, map(printable, _source_lines(name))), "", sep="\n")
    for _, reason in SOURCES.refusals():
        print(_wrapped(printable(reason)))


def _print_detectors() -> None:
    print(*map(_wrapped, detector_lines()), sep="\n")


def _print_sensors() -> None:
    print(*map(_wrapped, setup_lines()), sep="\n")


def _print_engines() -> None:
    for name, make in ENGINES.items():
        about = (inspect.getdoc(make) or "").partition("\n\n")[0]
        print(_wrapped(f"{name:12} {' '.join(about.split())}"))


_LISTS: dict[str, Callable[[], None]] = {
    "policies": _print_policies,
    "agents": _print_agents,
    "scenarios": _print_scenarios,
    "sources": _print_sources,
    "detectors": _print_detectors,
    "sensors": _print_sensors,
    "engines": _print_engines,
}
_ZERO = {"speed_kph": "0 is drawn", "target_kph": "0 is the protocol's"}
"""What 0 stands for, of parameters in which it is no number."""


def _source_lines(name: str) -> list[str]:
    """A source as it is asked for and its parameters, or why it cannot be loaded."""
    package = "" if name in SOURCES.built_in else f" [{package_of(SOURCES.entry(name))}]"
    try:
        source: Any = SOURCES.maker(name)
    except InvalidInput as error:
        return [f"{name:17} (broken) {error}{package}"]
    has_folder = issubclass(source, Recordings) and not source.shipped
    asked = f"{name}:FOLDER" if has_folder else name
    about, _, _ = (inspect.getdoc(source) or "").partition("\n\n")
    return [
        f"{asked:17} {' '.join(about.split())}{package}",
        *(
            f"    {field.name}={_rounded(field.default)}"
            for field in fields(source)
            # The folder is told behind the name.
            if field.name != "folder"
        ),
    ]


def _wrapped(line: str) -> str:
    """The line, broken at words where the terminal is narrower; what goes on is indented."""
    return textwrap.fill(
        line,
        shutil.get_terminal_size().columns,
        subsequent_indent=" " * 8,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _scenario_lines(name: str) -> list[str]:
    """A scenario and its parameters, or why it cannot be loaded."""
    # One that cannot be loaded must not hide the others.
    try:
        scenario = scenario_class(name)
    except InvalidInput as error:
        return [f"{name:12} (broken) {error} [{package_of(PLUGINS.entry(name))}]"]
    return [
        f"{name:12} {_summary(name, scenario)}",
        *(
            f"    {field.name}={_rounded(field.default)}{_choices(scenario, field)}"
            for field in fields(scenario)
        ),
    ]


def _choices(scenario: type[Scenario], field: Field[Any]) -> str:
    """The values that a parameter may have, and which the seed draws, in brackets; empty where
    there is nothing to tell.
    """
    # Those of another package may be called the same and mean something else.
    ours = scenario in SCENARIOS.values()
    told = (
        allowed(field),
        _ZERO.get(field.name, "") if ours else "",
        "None is drawn" if field.default is None else "",
    )
    text = "; ".join(filter(None, told))
    return f" ({text})" if text else ""


def _summary(name: str, scenario: type[Scenario]) -> str:
    """The first line of the docstring of a built-in scenario's module; of another class its own,
    its package and the id of its environment.
    """
    if name in SCENARIOS:
        return (inspect.getdoc(inspect.getmodule(scenario)) or "").partition("\n")[0]
    entry = PLUGINS.entry(name)
    own = (scenario.__doc__ or "").strip().partition("\n")[0]
    known = f"{entry.name}, " if is_environment_id(entry.name) else ""
    return f"{own} [{known}{package_of(entry)}]".strip()


def _rounded(value: object) -> str:
    """A default as it is given on a command line; numbers to two decimals."""
    if isinstance(value, tuple):
        return ",".join(map(_rounded, value))
    return str(round(value, 2)) if isinstance(value, float) else repr(value)
