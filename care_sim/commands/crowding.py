"""`care-sim crowding`: vehicles fill the dense street."""

from dataclasses import dataclass

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.crowding import crowding_study


@dataclass(frozen=True, kw_only=True)
class Crowding(FixedStudy):
    """Fill the dense street until the all-camera reserve collapses.

    Find where the all-camera reserve collapses as vehicles fill the dense street.
    """

    def __call__(self) -> int:
        """Run it."""
        return self.play("crowding", crowding_study, "crowding")
