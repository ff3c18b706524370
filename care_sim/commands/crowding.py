"""`care-sim crowding`: vehicles fill the dense street."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.crowding import crowding_study


@dataclass(frozen=True, kw_only=True)
class Crowding(FixedStudy):
    """Find where the all-camera reserve collapses as vehicles fill the dense street."""

    out: Path = Path("runs/crowding")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("crowding", crowding_study, self.out)
