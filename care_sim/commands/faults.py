"""`care-sim faults`: every fault grows, and the order of the policies changes."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.faults import fault_study


@dataclass(frozen=True, kw_only=True)
class Faults(FixedStudy):
    """Let every fault grow and find where the order of the policies changes."""

    out: Path = Path("runs/faults")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("faults", fault_study, self.out)
