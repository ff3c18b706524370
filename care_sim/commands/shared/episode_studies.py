"""What is common to the commands that play a study of the closed loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from care_sim.commands.shared.options import seeds_of
from care_sim.commands.shared.selection import playable
from care_sim.commands.shared.study_command import StudyCommand
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.study.episode_config import EpisodeConfig, grid, of_seeds

CONTROLS = ("fan",)
"""The best pattern without a camera in these scenes."""
_Configurations = Callable[[Sequence[int], Sequence[str]], Sequence[EpisodeConfig]]
"""The episodes of a study, from the seeds and the further policies."""


@dataclass(frozen=True, kw_only=True)
class EpisodeStudy(StudyCommand):
    """A study of the closed loop."""

    seeds: tuple[int, ...] = (5,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone.
    """


@dataclass(frozen=True, kw_only=True)
class FixedStudy(EpisodeStudy):
    """A study whose episodes are fixed, except for the seeds and for further policies."""

    also: tuple[str, ...] | None = None
    """Further policies, installed ones too, that are played and shown beside those of the study.
    Without this option, in the closed loop, the control `fan`; with no name after it, none."""

    def play(self, study: str, configurations: _Configurations, name: str) -> int:
        """Play the configurations of the seeds, with the further policies."""
        seeds = seeds_of(self.seeds)
        also, left_out = self.further_policies()
        configs = of_seeds(configurations(seeds[:1], also), seeds)
        return self.play_study(study, configs, name, left_out)

    def further_policies(self) -> tuple[list[str], list[str]]:
        """Those that can be played, and a line for each that cannot."""
        # It is tried on one task in every scenario.
        named = CONTROLS if self.also is None else self.also
        return playable(named, lambda name: grid(ENVIRONMENT_IDS, [name], [0.1], [0]))
