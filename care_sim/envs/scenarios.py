"""The environments of the closed loop by id: one per built-in scenario, and one for any other."""

from typing import Any

from care_sim.base.errors import BrokenScenario, InvalidInput
from care_sim.base.plugins import is_environment_id, scenario_of
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.sensing import arguments_of
from care_sim.scenarios import PLUGINS, scenario_class
from care_sim.scenarios.base import Scenario


class DartoutEnv(ClosedLoopEnv):
    """`CARE-Dartout-v0`: a person runs out from behind a parked trailer into an empty street.

    This is the paper's first closed-loop scene, at 30 km/h. The trailer parks at the right side of
    a two-way street. The person runs straight across. Perception does not report the trailer,
    because it is none of the five classes. `occluder="truck", occluder_reported=True` parks a
    reported vehicle. The person then emerges inside the hull of a track. The seed draws speeds,
    place and timing.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "dartout"


class DenseEnv(ClosedLoopEnv):
    """`CARE-Dense-v0`: the dart-out in a street lined with tracked vehicles.

    When the person appears, the camera shows five of the seven `vehicles`. At 3% of the cells, a
    reserve for every camera box leaves too few cells for the person.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "dense"


class CutInEnv(ClosedLoopEnv):
    """`CARE-CutIn-v0`: a car pulls out into the ego's lane from in front of a standing bus.

    The bus stands in the right one of two lanes. The car waits hidden in front of the bus and
    changes to the ego's lane (highway-env). A large vehicle returns enough points even with few
    rays, so the paper found no difference between policies.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "cutin"


class R157Env(ClosedLoopEnv):
    """`CARE-R157-v0`: a slower vehicle changes to the ego's lane (UN Regulation 157).

    Nothing hides the vehicle. The arguments set a case. The seed draws each value that is None, so
    that the regulation's careful human driver can prevent a collision.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "r157"


class NcapEnv(ClosedLoopEnv):
    """`CARE-NCAP-v0`: a test of Euro NCAP's protocols of emergency braking.

    The default test is a child who steps out from behind two parked cars. An ego that never brakes
    hits the target. The seed draws the side and everything that the protocol leaves open. With
    `test="drawn", speed_kph=0` the seed also draws test and speeds. The episode ends when the ego
    stands before the target's way, the two have parted, or the ego no longer approaches.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "ncap"


class DriveEnv(ClosedLoopEnv):
    """`CARE-Drive-v0`: a drive through a generated street, with bends, traffic and conflicts.

    The ego has six cameras and follows a route of 160 to 260 m: straight, round a bend or into a
    side street. Up to three times somebody comes out of hiding. The episode also ends at the end
    of the route. The first-sighting actor is the first conflict, or else the first encounter. A
    drive without an encounter has no such actor.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "drive"


class ScenarioEnv(ClosedLoopEnv):
    """Any `scenario` of the closed loop: of an installed package, by its name or the id of its
    environment; by its place, MODULE:OBJECT; or a class.

    An installed one whose entry is called `Mine-LeftBike-v0` has this environment under that id.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"

    def __init__(self, *, scenario: str | type[Scenario], **parameters: Any):
        if isinstance(scenario, str) and is_environment_id(scenario):
            _check_counts(scenario)
            scenario = scenario_of(scenario)
        kind = scenario_class(scenario)
        # Such a parameter would never reach the scenario.
        for name in arguments_of(type(self)):
            if name in kind.__dataclass_fields__:
                raise BrokenScenario(
                    f"scenario {kind.__module__}:{kind.__qualname__} has the parameter {name}, "
                    "which is an argument of every environment"
                )
        self.scenario_name = scenario
        super().__init__(**parameters)


def _check_counts(environment: str) -> None:
    """Raise InvalidInput for the id of an installed scenario whose name another one has."""
    for entry, reason in PLUGINS.refusals():
        if entry.name == environment:
            raise InvalidInput(f"environment {environment}: {reason}")
