"""`care-sim vehicle`: the paper's vehicle study, on simulated drives, and the time of its compute
path.
"""

from dataclasses import dataclass
from pathlib import Path

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.vehicle import vehicle_study


@dataclass(frozen=True, kw_only=True)
class Vehicle(FixedStudy):
    """Play the paper's vehicle study: late evidence in turns, a camera that fails in mid-drive,
    and a pose that is not exact.
    """

    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the study."""
    out: Path = Path("runs/vehicle")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("vehicle", vehicle_study, self.out)
