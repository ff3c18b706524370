"""Options of several commands: conditions of all episodes, parameters as NAME=VALUE, seeds."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.seed_ranges import CALIBRATION, split_of
from care_sim.commands.shared.selection import policy_parameters
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.perception.detectors import PROXY
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.parameters import parameters


@dataclass(frozen=True, kw_only=True)
class SensingOptions(ClosedLoopConditions):
    """Conditions, sensors and detector that all episodes share, of studies that fix the rest."""

    sensor: str = DEFAULT_SETUP
    """LiDAR and cameras: a name of `care-sim sensors`, or a .toml file of a set-up."""
    detector: str = PROXY
    """returns (the paper's proxy), graded (the surer the more returns), cluster (a real
    one), pillars (a learned one), torchscript, the name of an installed one, or MODULE:CLASS.
    """
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE, for example file=model.pt for torchscript."""

    def sensing(self) -> dict[str, Any]:
        """As arguments of `EpisodeConfig`. Raises InvalidInput for parameters that are none."""
        given = {field.name: getattr(self, field.name) for field in fields(SensingOptions)}
        return given | {"detector_parameters": parameters(self.detector_parameters)}


@dataclass(frozen=True, kw_only=True)
class Options(SensingOptions):
    """Everything that all episodes share."""

    scenario_parameters: tuple[str, ...] = ()
    """Physics of the scenario as NAME=VALUE, a range as NAME=LOW,HIGH, for example vehicles=7
    gap_m=0.8,1.2; see `care-sim scenarios`."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policies as NAME=VALUE, for example k_safe=0 for care-sbf; of one among
    several as POLICY.NAME=VALUE, for example ppo.path=weights.npz."""

    def arguments(self, policies: Sequence[str]) -> dict[str, Any]:
        """As arguments of `EpisodeConfig`, of studies that play these policies. Raises InvalidInput
        for parameters of another one.
        """
        return self.sensing() | {
            "scenario_parameters": parameters(self.scenario_parameters),
            "policy_parameters": policy_parameters(self.policy_parameters, policies),
        }


DEFAULT_OPTIONS = Options()
DEFAULT_SENSING = SensingOptions()
"""The defaults."""


def seeds_of(numbers: Sequence[int]) -> Sequence[int]:
    """The seeds that are meant by one number (that many, from 0) or by several (these; twice the
    same is that seed alone). Raises InvalidInput for a number below one or above that of the test
    seeds, and for seeds of several splits (`care_sim.base.seed_ranges`).
    """
    if len(numbers) != 1:
        split_of(numbers)
        return numbers
    if not 1 <= numbers[0] <= CALIBRATION:
        raise InvalidInput(
            f"seeds must be one number, a count from 1 to {CALIBRATION:,} (that many, from 0), or "
            "a list of two or more seeds (7 7 is seed 7 alone), got the count "
            f"{shown(numbers[0])}"
        )
    return range(numbers[0])
