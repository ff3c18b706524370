"""`care-sim firing`: what the hardware of the LiDAR can fire, and what that decides."""

from dataclasses import dataclass

from care_sim.commands.shared.protocol_variants import ProtocolVariants
from care_sim.study.designs.firing import FIRING_POLICIES, firing_plays, firing_study


@dataclass(frozen=True, kw_only=True)
class Firing(ProtocolVariants):
    """Play the dense street under every hardware, or with --source the first-sighting protocol, and
    tell what a policy that knows its hardware has over one whose demand is projected.
    """

    policies: tuple[str, ...] = FIRING_POLICIES
    """With --source: names of `care-sim policies`; `all` stands for all but the controls. `full`
    always runs with budget 1.0.
    """

    def __call__(self) -> int:
        """Run it."""
        self.check_options()
        if self.source is None:
            return self.play("firing", firing_study, self.folder("firing"))
        return self.play_scenes("firing-open-loop", "firing", firing_plays, self.source)
