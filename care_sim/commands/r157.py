"""`care-sim r157`: the preventable cut-ins of UN Regulation 157."""

from dataclasses import dataclass

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.episode_studies import EpisodeStudy
from care_sim.commands.shared.options import seeds_of
from care_sim.commands.shared.selection import check_values, playable
from care_sim.core.driver_settings import FIXED
from care_sim.study.designs.r157 import R157_BUDGETS, R157_POLICIES, r157_study
from care_sim.study.episode_config import grid


@dataclass(frozen=True, kw_only=True)
class R157(EpisodeStudy):
    """Play the preventable cut-ins of UN Regulation 157.

    Play the cut-ins that the careful human driver of UN Regulation 157 prevents, and tell which
    of them every policy avoids.
    """

    seeds: tuple[int, ...] = (1,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone.
    """
    policies: tuple[str, ...] = R157_POLICIES
    """Names of `care-sim policies`; `all` stands for all but the controls. `full` always runs with
    budget 1.0."""
    budgets: tuple[float, ...] = R157_BUDGETS
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    every: int = bounded(1, 1, 100)
    """Plays one of N preventable cases of the grid, by a fixed lot: 3 plays 127 of the 379."""
    driver: str = FIXED
    """fixed, or careful-human: the regulation's driver at the wheel."""

    def __call__(self) -> int:
        """Run it."""
        check_values(self, "policies", "budgets", "seeds")
        policies, left_out = playable(
            self.policies,
            lambda name: grid(["r157"], [name], self.budgets[:1], [0], driver=self.driver),
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        configs = r157_study(seeds_of(self.seeds), policies, self.budgets, self.every, self.driver)
        return self.play_study("r157", configs, "r157", left_out)
