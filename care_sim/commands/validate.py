"""`care-sim validate`: whether a world tells a good allocator from a lucky pattern."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded
from care_sim.commands.shared.episode_studies import EpisodeStudy
from care_sim.commands.shared.options import DEFAULT_SENSING, SensingOptions, seeds_of
from care_sim.commands.shared.play_options import named_after
from care_sim.commands.shared.selection import check_built, check_values
from care_sim.study.designs.validate import levels_of, validation_study
from care_sim.study.parameters import parameters


@dataclass(frozen=True, kw_only=True)
class Validate(EpisodeStudy):
    """Say whether a world tells good policies from lucky ones.

    Say whether a world of the closed loop discriminates: whether a camera leads the best
    control, a full scan leaves anything to win, and the reserves are told apart.
    """

    world: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="WORLD")]
    """dartout, dense, cutin, that of an installed package, or MODULE:CLASS; `care-sim scenarios`
    lists them.
    """
    seeds: tuple[int, ...] = (20,)
    """The test seeds. One number: that many, from 0. Several numbers: these, below 1,000; 7 7 is
    seed 7 alone.
    """
    training_seeds: int = bounded(10, 1, 1000)
    """Number of training seeds, from 10,000 on: on them the best are chosen and places learned."""
    budgets: tuple[float, ...] = (0.01, 0.03, 0.1)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    scenario_parameters: tuple[str, ...] = ()
    """Physics of the world as NAME=VALUE, a range as NAME=LOW,HIGH; see `care-sim scenarios`."""
    factors: tuple[str, ...] = ()
    """Further worlds, each with one parameter changed, as NAME=VALUE: for example mirrored=drawn
    ego_speed_mps=12.2,12.8."""
    conditions: Annotated[SensingOptions, tyro.conf.arg(name="")] = DEFAULT_SENSING
    """Conditions that all episodes share."""

    def __call__(self) -> int:
        """Run it."""
        check_values(self, "seeds", "budgets")
        base = parameters(self.scenario_parameters)
        check_built(self.world, base)
        levels = levels_of(base, [parameters([text]) for text in self.factors])
        configs = validation_study(
            self.world,
            levels,
            self.budgets,
            seeds_of(self.seeds),
            self.training_seeds,
            **self.conditions.sensing(),
        )
        return self.play_study("validate", configs, named_after("validate", self.world))
