"""Seeded scenarios by name. A scenario is a frozen dataclass of its physics with a `build(rng)`."""

import math
from dataclasses import Field, fields
from typing import Any

from care_sim.errors import InvalidInput, is_number, unknown
from care_sim.scenarios.base import Scenario
from care_sim.scenarios.cutin import CutIn
from care_sim.scenarios.dartout import Dartout
from care_sim.scenarios.dense import Dense

SCENARIOS: dict[str, type[Scenario]] = {"dartout": Dartout, "dense": Dense, "cutin": CutIn}


def make_scenario(name: str, **parameters: object) -> Scenario:
    """A scenario by name, its physics overridden by `parameters`.

    Raises InvalidInput for an unknown scenario or parameter, or a value out of its domain.
    """
    if name not in SCENARIOS:
        raise unknown("scenario", name, SCENARIOS)
    kind = SCENARIOS[name]
    known = {field.name: field for field in fields(kind)}
    for parameter, value in parameters.items():
        if parameter not in known:
            raise unknown(f"parameter of {name}", parameter, known)
        _check(f"{parameter} of {name}", value, known[parameter])
    return kind(**parameters)  # type: ignore[arg-type]


def _check(parameter: str, value: Any, field: Field[Any]) -> None:
    """A parameter takes what its default is: text, a flag, a whole number, a positive number, or a range of
    numbers (low, high), positive where the default is and the field is not marked SIGNED.
    """
    default: Any = field.default
    if isinstance(default, bool | str):
        fits, expected = isinstance(value, type(default)), type(default).__name__
    elif isinstance(default, int):
        fits, expected = isinstance(value, int) and not isinstance(value, bool), "a whole number"
    elif isinstance(default, float):
        fits, expected = is_number(value) and 0 < value < math.inf, "a positive number"
    else:
        positive = default[0] > 0 and not field.metadata.get("signed")
        fits = isinstance(value, tuple | list) and len(value) == 2 and all(map(is_number, value))
        fits = fits and -math.inf < value[0] <= value[1] < math.inf and (value[0] > 0 or not positive)
        expected = "two numbers, low and high" + (", above 0" if positive else "")
    if not fits:
        raise InvalidInput(f"{parameter} must be {expected}, got {value!r}")
