"""The detector that an environment's arguments name."""

from collections.abc import Mapping

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.conditions import MIN_RETURNS, Conditions
from care_sim.core.rig import Rig
from care_sim.perception.detectors import CLUSTER, PROXY, check_detector, make_detector
from care_sim.perception.points_only import Detector


def detector_of(
    name: str,
    parameters: Mapping[str, object] | None,
    conditions: Conditions,
    rig: Rig,
) -> Detector:
    """The detector `name` with its own `parameters`.

    The proxy's threshold is the condition `min_returns`. Raises InvalidInput for a name or
    parameter that is unknown, and for a `min_returns` beside another detector.
    """
    check_detector(name)
    if name != PROXY and conditions.min_returns != MIN_RETURNS:
        raise InvalidInput(f"min_returns is of the detector {PROXY}, {name} does not know it")
    if not isinstance(parameters, Mapping | None):
        raise InvalidInput(f"detector_parameters must map names to values, got {shown(parameters)}")
    if name == PROXY and "min_returns" in (parameters or {}):
        raise InvalidInput("min_returns is a condition, give it without detector_parameters")
    own: dict[str, object] = {}
    if name == PROXY:
        own = {"min_returns": conditions.min_returns}
    elif name == CLUSTER:
        own = {"grid": rig.grid}
    return make_detector(name, rig.sensor_height_m, **own | dict(parameters or {}))
