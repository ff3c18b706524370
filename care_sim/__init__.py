"""CARE-Sim: a closed-loop benchmark for adaptive LiDAR sensing.

Importing the package registers the environments of the closed loop, `CARE-Dartout-v0`,
`CARE-Dense-v0`, `CARE-CutIn-v0`, `CARE-NCAP-v0` and `CARE-R157-v0`, and of the open loop,
`CARE-Street-v0` and `CARE-Replay-v0`.
"""

# First of all: an interrupt may come while the rest is imported, and limits may be too low for it.
# The limits settle the caches of Numba and Matplotlib, too.
import care_sim.base.interrupts
import care_sim.base.limits  # noqa: F401

# isort: split
from importlib import import_module
from typing import TYPE_CHECKING

from care_sim.base.errors import InvalidInput, MissingExtra, unknown
from care_sim.envs import register_all

if TYPE_CHECKING:
    from care_sim.core.allocation import allocate
    from care_sim.core.belief import Belief
    from care_sim.core.grid import AngularGrid
    from care_sim.core.rig import Rig
    from care_sim.core.sensor_setup import SensorSetup
    from care_sim.core.types import CLASSES, Demand, Detections, ImageDetections, Tracks
    from care_sim.policies import make_policy, policy_names
    from care_sim.policies.base import Policy, PrivilegedPolicy
    from care_sim.sources.box_films import film_of_boxes

    __version__: str

_PLACES = {
    "CLASSES": "core.types",
    "AngularGrid": "core.grid",
    "Belief": "core.belief",
    "Demand": "core.types",
    "Detections": "core.types",
    "ImageDetections": "core.types",
    "Policy": "policies.base",
    "PrivilegedPolicy": "policies.base",
    "Rig": "core.rig",
    "SensorSetup": "core.sensor_setup",
    "Tracks": "core.types",
    "allocate": "core.allocation",
    "film_of_boxes": "sources.box_films",
    "make_policy": "policies",
    "policy_names": "policies",
}
"""Where each name is. It is imported when it is used: NumPy, SciPy and Numba take a second."""
__all__ = [
    "CLASSES",
    "AngularGrid",
    "Belief",
    "Demand",
    "Detections",
    "ImageDetections",
    "InvalidInput",
    "MissingExtra",
    "Policy",
    "PrivilegedPolicy",
    "Rig",
    "SensorSetup",
    "Tracks",
    "allocate",
    "film_of_boxes",
    "make_policy",
    "names",
    "policy_names",
]

register_all()


_NAMES = {
    "policies": "policies:policy_names",
    "scenarios": "scenarios:scenario_names",
    "sensors": "sensors.setups:setup_names",
    "detectors": "perception.detectors:detector_names",
    "sources": "sources.installed:source_names",
    "engines": "sensors.engines:engine_names",
    "agents": "training.agents:agent_names",
}


def names(kind: str) -> list[str]:
    """Return the names of a kind: policies, scenarios, sensors, detectors, sources, engines or
    agents, the built-in ones and those of installed packages. Raises InvalidInput for another kind.

    `care-sim list KIND` shows what each is.
    """
    if kind not in _NAMES:
        raise unknown("kind", kind, _NAMES)
    module, function = _NAMES[kind].split(":")
    return list(getattr(import_module(f"care_sim.{module}"), function)())


def __getattr__(name: str) -> object:
    """Import what is asked for: a public name, or a room such as `care_sim.core`."""
    if name == "__version__":
        from importlib.metadata import version

        # Cached: the version is read from a file, and every task of a study needs it.
        globals()[name] = version("care-sim")
        return globals()[name]
    if name in _PLACES:
        return getattr(import_module(f"care_sim.{_PLACES[name]}"), name)
    if name in ("core", "policies", "perception"):
        # With all that make_policy needs, such as `care_sim.core.allocation`.
        import_module("care_sim.policies")
        return import_module(f"care_sim.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
