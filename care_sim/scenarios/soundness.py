"""Why an object that an installed package, or a place, names as a scenario is none."""

import inspect
from collections.abc import Iterator
from typing import Any

from care_sim.base.plugins import dataclass_faults
from care_sim.core.pinhole import PinholeCamera
from care_sim.scenarios.base import Scenario


def scenario_faults(made: Any) -> Iterator[str]:
    """Why a loaded object is no scenario, one text per reason. `care_sim.base.plugins` asks it."""
    if not (inspect.isclass(made) and issubclass(made, Scenario)):
        yield "is no Scenario"
        return
    yield from dataclass_faults(made)
    cameras = made.cameras
    if not (isinstance(cameras, tuple) and all(isinstance(one, PinholeCamera) for one in cameras)):
        yield f"has the cameras {cameras!r:.80}; allowed is a tuple of PinholeCamera"
