"""`care-sim faults`: every fault grows, and the order of the policies changes."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import tyro

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.commands.shared.options import DEFAULT_SENSING, SensingOptions
from care_sim.study.designs.faults import fault_study


@dataclass(frozen=True, kw_only=True)
class Faults(FixedStudy):
    """Let every fault grow until the order of the policies changes."""

    conditions: Annotated[SensingOptions, tyro.conf.arg(name="")] = DEFAULT_SENSING
    """Conditions that all episodes share, other than those that grow."""

    def __call__(self) -> int:
        """Run it."""
        study = partial(fault_study, **self.conditions.sensing())
        return self.play("faults", study, "faults")
