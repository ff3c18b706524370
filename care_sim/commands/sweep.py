"""`care-sim sweep`: every combination of scenarios, policies, budgets, faults and seeds."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.episode_studies import EpisodeStudy
from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options, seeds_of
from care_sim.commands.shared.selection import buildable, check_values, in_turn, playable
from care_sim.study.episode_config import grid


@dataclass(frozen=True, kw_only=True)
class Sweep(EpisodeStudy):
    """Play every combination of scenarios, policies, budgets, faults.

    Each is played on every seed.
    """

    scenarios: tuple[str, ...] = ("dartout", "dense", "cutin")
    """Names of `care-sim scenarios`, or MODULE:CLASS; `all` stands for all that have a name."""
    policies: tuple[str, ...] = ("history", "all-camera", "care", "care-sightlines", "fan", "full")
    """Names of `care-sim policies`; `all` stands for all but the controls. `full` always runs with
    budget 1.0."""
    budgets: tuple[float, ...] = (0.1,)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    false_negative_rates: tuple[float, ...] = ()
    """Several values of --false-negative-rate, in turn."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        check_values(self, "scenarios", "policies", "budgets", "seeds")
        common = self.conditions.arguments(self.policies)
        # What is not ours may be broken: a scenario or a policy is left out, and the others play.
        scenarios, unbuilt = buildable(self.scenarios, common["scenario_parameters"])
        # A policy is tried on one seed and budget.
        policies, left_out = playable(
            self.policies, lambda name: grid(scenarios, [name], self.budgets[:1], [0], **common)
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        rates = in_turn(self.false_negative_rates, "false_negative_rate", common)
        latencies = in_turn(self.camera_latencies, "camera_latency", common)
        configs = grid(
            scenarios, policies, self.budgets, seeds_of(self.seeds), rates, latencies, **common
        )
        return self.play_study("sweep", configs, "sweep", [*unbuilt, *left_out])
