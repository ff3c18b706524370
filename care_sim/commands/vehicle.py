"""`care-sim vehicle`: the paper's vehicle study on simulated drives."""

from dataclasses import dataclass

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.vehicle import vehicle_study


@dataclass(frozen=True, kw_only=True)
class Vehicle(FixedStudy):
    """Play late evidence, a failing camera, a wrong pose.

    Play the paper's vehicle study: late evidence in turns, a camera that fails in mid-drive, a
    pose that is not exact.
    """

    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the study; not
    care-sbf, full or all-camera, of which it asks some questions itself."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("vehicle", vehicle_study, "vehicle")
