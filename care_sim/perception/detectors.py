"""Detectors by name: the proxy, the built-in real ones, and those that installed packages add.

An entry of the group `care_sim.detectors` names a `PointDetector` class, or another callable that
makes one from the user's parameters. If two entries have one name, the first on the path counts. A
built-in name cannot be taken.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_known
from care_sim.base.digests import declared_files
from care_sim.base.errors import InvalidInput, MissingExtra, error_line, printable, shown
from care_sim.base.plugins import Plugins
from care_sim.perception.cluster.detector import ClusterDetector
from care_sim.perception.lifetimes import get_or_make
from care_sim.perception.measured.detector import CenterPoint, Megvii, PointRCNN
from care_sim.perception.measured.tables import MEASURED
from care_sim.perception.network_detectors import OnnxDetector, TorchScriptDetector
from care_sim.perception.pillars.detector import PillarsDetector
from care_sim.perception.points_only import (
    BrokenDetector,
    Detector,
    PointDetector,
    PointsOnly,
)
from care_sim.perception.proxy import GradedProxy, ReturnsProxy
from care_sim.perception.recorded import RecordedDetector

PROXY = "returns"
"""The paper's proxy."""
GRADED = "graded"
"""The proxy whose recall grows with returns."""
CLUSTER = "cluster"
"""The classical detector. It gets the grid, and so the distance of neighbouring points."""
PILLARS = "pillars"
"""The learned one."""
RECORDED = "recorded"
"""The upper bound: what a real detector reported of full scans."""
PRIVILEGED = (PROXY, GRADED, *MEASURED, RECORDED)
"""Detectors that read more than points; all others are `PointDetector`s."""

FED = ("sweeps", "track_score")
"""Parameters of every `PointDetector` that set its input."""


def _faults(made: Any) -> Iterator[str]:
    if not callable(made):
        yield "is not callable"


DETECTORS: Plugins[Any] = Plugins(
    kind="detector",
    group="care_sim.detectors",
    built_in={
        PROXY: ReturnsProxy,
        GRADED: GradedProxy,
        CenterPoint.name: CenterPoint,
        Megvii.name: Megvii,
        PointRCNN.name: PointRCNN,
        CLUSTER: ClusterDetector,
        PILLARS: PillarsDetector,
        RECORDED: RecordedDetector,
        "torchscript": TorchScriptDetector,
        "onnx": OnnxDetector,
    },
    faults=_faults,
)


def detector_names() -> list[str]:
    """Return the names for `make_detector`: the proxy, the built-in real ones, then those of
    installed packages.
    """
    return DETECTORS.names()


def check_detector(name: object) -> None:
    """Raise InvalidInput for a name that is not a detector."""
    DETECTORS.check(name)


def make_detector(name: str, sensor_height_m: float, /, **parameters: object) -> Detector:
    """Return the detector for a film whose LiDAR is `sensor_height_m` above the road.

    All detectors but the proxies get only points. Their parameters `sweeps` and `track_score` set
    their input. Equal parameters return the same stateless detector
    (`care_sim.perception.points_only.PointDetector`).

    Raises InvalidInput for an unknown name or parameter, or a value that is not allowed. Raises
    BrokenDetector for one that cannot be loaded or made, MissingExtra for one whose library is not
    installed.
    """
    make = _maker(name)
    fed = {} if name in PRIVILEGED else _fed(make, parameters)
    own = {given: value for given, value in parameters.items() if given not in fed}
    _check_parameters(name, make, own)
    if name in PRIVILEGED:
        proxy: Detector = make(**own)
        return proxy
    declared = () if name in DETECTORS.built_in else declared_files(DETECTORS.entry(name))
    detector = get_or_make(make, own, partial(_point_detector, name, make, own), declared)
    again = partial(make_detector, name, sensor_height_m, **parameters)
    return PointsOnly(name, detector, sensor_height_m, **fed, again=again)


def sweeps_wanted(name: str, parameters: Mapping[str, object]) -> int:
    """Return the number of sweeps that a detector wants at a keyframe. Raises as `make_detector`
    does.
    """
    # This detector never detects, so any height will do.
    return 1 if name in PRIVILEGED else make_detector(name, 1.0, **parameters).gathers


def files_read(name: str, parameters: Mapping[str, object]) -> tuple[Path, ...]:
    """Return the files that a detector declares to read (`PointDetector`). Raises as
    `make_detector` does.
    """
    return () if name in PRIVILEGED else make_detector(name, 1.0, **parameters).files


def detector_lines() -> list[str]:
    """One line per detector: its name and what it does, or why it cannot be loaded."""
    return [printable(f"{name:12} {_summary(name)}") for name in detector_names()]


def _maker(name: str) -> Callable[..., Any]:
    """Return the maker of a detector. Raises BrokenDetector if it cannot be loaded."""
    check_detector(name)
    try:
        return DETECTORS.maker(name)
    except InvalidInput as error:
        raise BrokenDetector(f"detector {name} cannot be loaded: {error}") from error


def _fed(make: Callable[..., Any], parameters: dict[str, object]) -> dict[str, Any]:
    """Return the parameters of a detector's input, except those that its maker takes itself."""
    try:
        own = inspect.signature(make).parameters
    except (TypeError, ValueError):
        return {}
    return {n: parameters[n] for n in FED if n in parameters and n not in own}


def _point_detector(
    name: str, make: Callable[..., Any], parameters: dict[str, object]
) -> PointDetector:
    try:
        detector: PointDetector = make(**parameters)
    except (KeyboardInterrupt, InvalidInput, MissingExtra):
        raise
    # Foreign code may raise anything; some leaves by `sys.exit`.
    except BaseException as error:
        raise BrokenDetector(
            f"detector {name} refuses {shown(parameters)}: {error_line(error)}"
        ) from error
    if not callable(getattr(detector, "detect", None)):
        kind = type(detector).__name__
        raise BrokenDetector(f"detector {name} is no PointDetector: {kind} has no method detect")
    return detector


def _check_parameters(
    name: str, make: Callable[..., object], parameters: dict[str, object]
) -> None:
    try:
        signature = inspect.signature(make)
    except (TypeError, ValueError) as error:
        raise BrokenDetector(f"detector {name} tells no parameters") from error
    # A detector that accepts any name checks names itself.
    accepted = signature.parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted):
        return
    known = [*signature.parameters, *(() if name in PRIVILEGED else FED)]
    for given in parameters:
        check_known(f"parameter of detector {name}", given, known)
    for parameter in accepted:
        needed = (
            parameter.default is parameter.empty and parameter.kind is not parameter.VAR_POSITIONAL
        )
        if needed and parameter.name not in parameters:
            raise InvalidInput(f"detector {name} needs the parameter {parameter.name}")


def _summary(name: str) -> str:
    try:
        make = _maker(name)
    except BrokenDetector as error:
        return f"(broken) {error}"
    about, _, _ = (inspect.getdoc(make) or "").partition("\n\n")
    return " ".join(about.split())
