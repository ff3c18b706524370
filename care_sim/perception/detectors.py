"""Detectors by name: the proxy, the built-in real ones, and those that installed packages add.

An entry of the group `care_sim.detectors` names a `PointDetector` class, or another callable that
makes one from the user's parameters. Of two entries with one name the first on the path counts, and
a built-in name is taken.
"""

import inspect
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.text import printable, shown
from care_sim.perception.cluster.detector import ClusterDetector
from care_sim.perception.points_only import BrokenDetector, PointDetector, PointsOnly
from care_sim.perception.proxy import Detector, ReturnsProxy
from care_sim.perception.torchscript import TorchScriptDetector

ENTRY_POINTS = "care_sim.detectors"
PROXY = "returns"

Maker = Callable[..., PointDetector]

_REAL: dict[str, Maker] = {"cluster": ClusterDetector, "torchscript": TorchScriptDetector}
BUILT_IN = (PROXY, *_REAL)


def detector_names() -> list[str]:
    """Names that `make_detector` knows: the proxy, the built-in real ones, then those of installed
    packages.
    """
    return [*BUILT_IN, *sorted(set(entries()) - set(BUILT_IN))]


def check_detector(name: object) -> None:
    """Raise InvalidInput for a name that is not a detector."""
    check_known("detector", name, detector_names())


def make_detector(name: str, sensor_height_m: float, /, **parameters: object) -> Detector:
    """The detector for a film whose LiDAR stands `sensor_height_m` above the road.

    All but the proxy are handed points alone, whoever wrote them. Raises InvalidInput for an
    unknown name or parameter, or a value that is not allowed; BrokenDetector for one that cannot be
    loaded or made; MissingExtra for one whose library is not installed.
    """
    check_detector(name)
    if name == PROXY:
        _check_parameters(name, ReturnsProxy, parameters)
        return ReturnsProxy(**parameters)  # type: ignore[arg-type]
    make = _maker(name)
    _check_parameters(name, make, parameters)
    try:
        detector = make(**parameters)
    except (InvalidInput, MissingExtra):
        raise
    except (Exception, SystemExit) as error:
        raise BrokenDetector(
            f"detector {name} refuses {shown(parameters)}: {_in_a_line(error)}"
        ) from error
    if not callable(getattr(detector, "detect", None)):
        raise BrokenDetector(
            f"detector {name} is no PointDetector: {type(detector).__name__} has no method detect"
        )
    return PointsOnly(name, detector, sensor_height_m)


def listing() -> list[str]:
    """A line a detector: its name and what it does, or why it cannot be loaded."""
    return [printable(f"{name:12} {_summary(name)}") for name in detector_names()]


def _summary(name: str) -> str:
    try:
        make = ReturnsProxy if name == PROXY else _maker(name)
    except BrokenDetector as error:
        return f"(broken) {error}"
    described = inspect.getmodule(make) if name in BUILT_IN else make
    return (inspect.getdoc(described) or "").partition("\n")[0]


def _maker(name: str) -> Maker:
    if name in _REAL:
        return _REAL[name]
    return _load(name, entries()[name])


def _load(name: str, entry: EntryPoint) -> Maker:
    try:
        make = entry.load()
    except (Exception, SystemExit) as error:
        raise BrokenDetector(f"detector {name} cannot be loaded: {_in_a_line(error)}") from error
    if not callable(make):
        raise BrokenDetector(f"detector {name} cannot be loaded: {entry.value} makes nothing")
    return make  # type: ignore[no-any-return]


def entries() -> dict[str, EntryPoint]:
    """The detectors of installed packages by name."""
    return {entry.name: entry for entry in reversed(tuple(entry_points(group=ENTRY_POINTS)))}


def _check_parameters(
    name: str, make: Callable[..., object], parameters: dict[str, object]
) -> None:
    try:
        signature = inspect.signature(make)
    except (TypeError, ValueError) as error:
        raise BrokenDetector(f"detector {name} tells no parameters") from error
    accepted = signature.parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return
    for given in parameters:
        check_known(f"parameter of detector {name}", given, signature.parameters)
    for parameter in accepted:
        needed = (
            parameter.default is parameter.empty and parameter.kind is not parameter.VAR_POSITIONAL
        )
        if needed and parameter.name not in parameters:
            raise InvalidInput(f"detector {name} needs the parameter {parameter.name}")


def _in_a_line(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
