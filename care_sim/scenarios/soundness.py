"""Why an object that an installed package, or a place, names as a scenario is none."""

import inspect
from collections.abc import Iterator
from dataclasses import MISSING, fields
from typing import Any

from care_sim.core.pinhole import PinholeCamera
from care_sim.scenarios.base import Scenario


def scenario_faults(made: Any) -> Iterator[str]:
    """Why a loaded object is no scenario, one text per reason. `care_sim.base.plugins` asks it."""
    if not (inspect.isclass(made) and issubclass(made, Scenario)):
        yield "is no Scenario"
        return
    if inspect.isabstract(made):
        yield f"is abstract: it lacks {', '.join(sorted(made.__abstractmethods__))}"
    # Without the decorator the numbers are attributes of the class, and nobody can set them.
    if "__dataclass_fields__" not in vars(made) and inspect.get_annotations(made):
        yield "is no dataclass: @dataclass(frozen=True) stands above its class"
    for field in fields(made):
        if field.default is MISSING:
            yield f"has no default for {field.name}"
    cameras = made.cameras
    if not (isinstance(cameras, tuple) and all(isinstance(one, PinholeCamera) for one in cameras)):
        yield f"has the cameras {cameras!r:.80}; allowed is a tuple of PinholeCamera"
