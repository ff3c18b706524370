"""`care-sim firing`: what the hardware of the LiDAR can fire, and what that decides."""

from dataclasses import dataclass, replace
from functools import partial

from care_sim.base.errors import report_problems
from care_sim.commands.shared.protocol_variants import ProtocolVariants
from care_sim.commands.shared.selection import check_values
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.designs.firing import FIRING_POLICIES, firing_plays, firing_study, fitting


@dataclass(frozen=True, kw_only=True)
class Firing(ProtocolVariants):
    """Tell what a LiDAR that fires tiles, rows or a window decides.

    Play the dense street under every hardware, or with --source the first-sighting protocol, and
    tell what a policy that knows its hardware has over one whose demand is projected.

    Units that do not divide the grid of a set-up are left out, as are the study's policies with
    weights of another grid; a line names each.
    """

    sensors: tuple[str, ...] = (DEFAULT_SETUP,)
    """Without --source: names of `care-sim sensors` or .toml files of set-ups."""

    policies: tuple[str, ...] = FIRING_POLICIES
    """With --source: names of `care-sim policies`; `all` stands for all but the controls. `full`
    always runs with budget 1.0.
    """

    def __call__(self) -> int:
        """Run it."""
        self.check_options()
        if self.source is None:
            check_values(self, "sensors")
            report_problems([line for sensor in self.sensors for line in fitting(sensor).left_out])
            study = partial(firing_study, sensors=self.sensors)
            return self.play("firing", study, self.name_of("firing"))
        # Others are checked when they are played, as in every study.
        own = [name for name in self.policies if name in FIRING_POLICIES]
        fits = fitting(self.sensor or DEFAULT_SETUP, own)
        report_problems(fits.left_out)
        unfit = {*own} - {*fits.policies}
        policies = tuple(name for name in self.policies if name not in unfit)
        command = replace(self, policies=policies)
        return command.play_scenes("firing-open-loop", "firing", firing_plays, self.source)
