"""Studies of the closed loop."""

from collections.abc import Callable, Sequence
from functools import partial

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.commands.options.shared import seeds_of
from care_sim.commands.options.studies import (
    R157,
    Crowding,
    Faults,
    FixedStudy,
    Ncap,
    Reproduce,
    Sweep,
    Validate,
    Vehicle,
)
from care_sim.commands.shared.play_study import play_study
from care_sim.commands.shared.selection import (
    arguments_of,
    buildable,
    check_built,
    check_values,
    expanded,
    in_turn,
    named_after,
    playable,
)
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.scenarios.ncap.table import TESTS
from care_sim.study.designs.faults import fault_study
from care_sim.study.designs.paper import crowding_study, paper_study
from care_sim.study.designs.standards import ncap_cases, ncap_study, r157_study
from care_sim.study.designs.validate import levels_of, validation_study
from care_sim.study.designs.vehicle import vehicle_study
from care_sim.study.episode_config import EpisodeConfig, grid, of_seeds
from care_sim.study.run_config import parameters

CONTROLS = ("fan",)
"""The best pattern without a camera in these scenes."""
_Configurations = Callable[[Sequence[int], Sequence[str]], Sequence[EpisodeConfig]]
"""The episodes of a study, from the seeds and the further policies."""


def further_policies(options: FixedStudy) -> tuple[list[str], list[str]]:
    """Those that can be played, and a line for each that cannot."""
    # It is tried on one task in every scenario.
    named = CONTROLS if options.also is None else options.also
    return playable(named, lambda name: grid(ENVIRONMENT_IDS, [name], [0.1], [0]), 0)


def fixed_study(
    options: FixedStudy, study: str, configurations: _Configurations, folder: str = ""
) -> int:
    """Play the configurations of the seeds, with the further policies."""
    seeds = seeds_of(options.seeds)
    also, left_out = further_policies(options)
    configs = of_seeds(configurations(seeds[:1], also), seeds)
    return play_study(options, study, configs, folder or study, left_out)


def reproduce(options: Reproduce) -> int:
    """Play the paper's study and print it beside the paper's figures."""
    return fixed_study(options, "paper", paper_study, "reproduce")


def crowding(options: Crowding) -> int:
    """Fill the dense street with vehicles."""
    return fixed_study(options, "crowding", crowding_study)


def faults(options: Faults) -> int:
    """Let every fault grow."""
    return fixed_study(options, "faults", partial(fault_study, **options.sensing()))


def vehicle(options: Vehicle) -> int:
    """Play the paper's vehicle study."""
    return fixed_study(options, "vehicle", vehicle_study)


def sweep(options: Sweep) -> int:
    """Play every combination of scenarios, policies, budgets, faults and seeds."""
    check_values(options, "scenarios", "policies", "budgets", "seeds")
    common = arguments_of(options, options.policies)
    # Skip third-party scenarios and policies that fail; the others play.
    scenarios, unbuilt = buildable(options.scenarios, common["scenario_parameters"])
    # A policy is tried on one seed and budget.
    policies, left_out = playable(
        options.policies, lambda name: grid(scenarios, [name], options.budgets[:1], [0], **common)
    )
    rates = in_turn(options.false_negative_rates, "false_negative_rate", common)
    latencies = in_turn(options.camera_latencies, "camera_latency", common)
    seeds = seeds_of(options.seeds)
    configs = grid(scenarios, policies, options.budgets, seeds, rates, latencies, **common)
    return play_study(options, "sweep", configs, "sweep", [*unbuilt, *left_out])


def ncap(options: Ncap) -> int:
    """Play the Euro NCAP tests."""
    check_values(options, "tests", "policies", "budgets", "seeds")
    tests = expanded(options.tests, TESTS)
    for name in tests:
        check_known("test", name, TESTS)
    if not ncap_cases(tests, options.step_kph):
        raise InvalidInput(f"no speed of these tests is a multiple of {options.step_kph:g} km/h")
    common = options.sensing()
    policies, left_out = playable(
        options.policies, lambda name: grid(["ncap"], [name], options.budgets[:1], [0], **common)
    )
    seeds = seeds_of(options.seeds)
    configs = ncap_study(seeds, policies, tests, options.budgets, options.step_kph, **common)
    return play_study(options, "ncap", configs, "ncap", left_out)


def r157(options: R157) -> int:
    """Play the preventable cut-ins of UN Regulation 157."""
    check_values(options, "policies", "budgets", "seeds")
    driver = options.driver
    policies, left_out = playable(
        options.policies,
        lambda name: grid(["r157"], [name], options.budgets[:1], [0], driver=driver),
    )
    seeds = seeds_of(options.seeds)
    configs = r157_study(seeds, policies, options.budgets, options.every, driver)
    return play_study(options, "r157", configs, "r157", left_out)


def validate(options: Validate) -> int:
    """Say whether a world tells good policies from lucky ones."""
    check_values(options, "seeds", "budgets")
    base = parameters(options.scenario_parameters)
    check_built(options.world, base)
    levels = levels_of(base, [parameters([text]) for text in options.factors])
    configs = validation_study(
        options.world,
        levels,
        options.budgets,
        seeds_of(options.seeds),
        options.training_seeds,
        **options.sensing(),
    )
    return play_study(options, "validate", configs, named_after("validate", options.world))
