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

    The paper's first closed-loop scene, at 30 km/h. The seed draws the speeds, the place and the
    timing; see `care_sim.scenarios.dartout.CrossingScenario` for the physics and their sources,
    all of which can be passed as arguments. `occluder="truck", occluder_reported=True` parks a
    vehicle that perception reports instead.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "dartout"


class DenseEnv(ClosedLoopEnv):
    """`CARE-Dense-v0`: the dart-out in a street lined with tracked vehicles.

    There are `vehicles` (7) of them, five in the camera's view. At 3% of the cells a reserve for
    every camera box starves the person; `care_sim.scenarios.dartout` reckons why, cell by cell.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "dense"


class CutInEnv(ClosedLoopEnv):
    """`CARE-CutIn-v0`: a car pulls out into the ego's lane from in front of a standing bus.

    A large vehicle returns enough points even when starved; the paper found no separation here.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "cutin"


class R157Env(ClosedLoopEnv):
    """`CARE-R157-v0`: a slower vehicle changes over into the ego's lane (UN Regulation 157).

    `ego_kph`, `relative_kph`, `gap_m`, `lateral_mps`, `kind` and `side` set a case; what is not
    given the seed draws among the cases that the regulation's careful human driver prevents from
    ending in a collision (`care_sim.scenarios.r157`). Nothing hides the vehicle.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "r157"


class NcapEnv(ClosedLoopEnv):
    """`CARE-NCAP-v0`: a test of Euro NCAP's protocols of emergency braking.

    `test`, `speed_kph` and `target_kph` say which: a child who steps out from behind two parked
    cars (`CPNCO-50`, the default), pedestrians, bicyclists and cars that cross, go ahead, brake or
    come towards the ego, which turns in some. An ego that does not brake hits the target. The seed
    draws what the protocol leaves open, and the side; with `test="drawn", speed_kph=0` the test and
    its speeds, too. The test is over, and the episode terminated,
    when the ego stands before the target's way, the ways have parted, or the ego is no faster than
    the target ahead.
    """

    __doc__ = f"{__doc__}\n    {ClosedLoopEnv.__doc__}"
    scenario_name = "ncap"


class DriveEnv(ClosedLoopEnv):
    """`CARE-Drive-v0`: a drive through a generated street, with bends, traffic and conflicts.

    The ego follows a route of 160 to 260 m, straight on, round a bend or off into a side street,
    with six cameras. Up to three times somebody comes out of hiding, from either side: to a
    conflict, a near miss or a stop at the edge of the lanes. The episode ends at the end of the
    way, too. The outcome is a `care_sim.loops.records.DriveOutcome`: what the contract says of the
    first-sighting actor is of the first encounter that is a conflict, else of the first; without an
    encounter there is none, and `undetected_to_m` is None, too. See `care_sim.scenarios.drive`.
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
