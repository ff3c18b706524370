"""Readable descriptions of scenarios: name, summary, parameters with their bounds."""

from collections.abc import Iterator
from dataclasses import Field, fields
from typing import Any

from care_sim.base.checks import allowed, option_text
from care_sim.base.errors import InvalidInput
from care_sim.base.plugins import is_environment_id, package_of
from care_sim.scenarios import PLUGINS, SCENARIOS, scenario_class, scenario_names
from care_sim.scenarios.base import Scenario

_ZERO = {"speed_kph": "0 is drawn", "target_kph": "0 is the protocol's"}
"""Meaning of 0, for parameters in which 0 is no number."""


def scenario_lines() -> Iterator[str]:
    """A line per scenario and one per parameter, an empty line between scenarios; at the end why
    entries of packages are refused.
    """
    for name in scenario_names():
        yield from _scenario_lines(name)
        yield ""
    yield from (reason for _, reason in PLUGINS.refusals())


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
            f"    {field.name}={option_text(field.default)}{_choices(scenario, field)}"
            for field in fields(scenario)
        ),
    ]


def _choices(scenario: type[Scenario], field: Field[Any]) -> str:
    """The values that a parameter may have, and which the seed draws, in brackets; empty where
    there is nothing to tell.
    """
    # Parameters of another package may have the same name and another meaning.
    ours = scenario in SCENARIOS.values()
    told = (
        allowed(field),
        _ZERO.get(field.name, "") if ours else "",
        "None is drawn" if field.default is None else "",
    )
    text = "; ".join(filter(None, told))
    return f" ({text})" if text else ""


def _summary(name: str, scenario: type[Scenario]) -> str:
    """The first line of a class's docstring; of one that is not built in its package, too, and the
    id of its environment.
    """
    own = (scenario.__doc__ or "").strip().partition("\n")[0]
    if name in SCENARIOS:
        return own
    entry = PLUGINS.entry(name)
    known = f"{entry.name}, " if is_environment_id(entry.name) else ""
    return f"{own} [{known}{package_of(entry)}]".strip()
