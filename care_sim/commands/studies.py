"""The subcommands that play a study, of the closed loop or of the open one."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, report_problems
from care_sim.commands.options.shared import seeds_of
from care_sim.commands.options.studies import (
    R157,
    Ablate,
    Crowding,
    Faults,
    Firing,
    FixedStudy,
    Mechanism,
    Ncap,
    Order,
    Protocol,
    ProtocolVariants,
    Realism,
    Reproduce,
    Sweep,
    Validate,
    Vehicle,
)
from care_sim.commands.shared.run_study import play_study
from care_sim.commands.shared.selection import (
    arguments_of,
    buildable,
    check_built,
    check_values,
    common_of,
    expanded,
    named_after,
    playable,
    source_named,
    take_values,
)
from care_sim.envs import ENVIRONMENT_IDS
from care_sim.scenarios.ncap.table import TESTS
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.ablations import ablation_plays, ablation_study, quarter_of
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.faults import fault_study
from care_sim.study.designs.firing import (
    firing_plays,
    firing_study,
    fitting,
    order_plays,
    order_study,
)
from care_sim.study.designs.paper import crowding_study, paper_study
from care_sim.study.designs.realism import (
    HEADLINES,
    film_conditions,
    headline_conditions,
    realism_plays,
    realism_study,
)
from care_sim.study.designs.standards import ncap_cases, ncap_study, r157_study
from care_sim.study.designs.validate import levels_of, validation_study
from care_sim.study.designs.vehicle import vehicle_study
from care_sim.study.episode_config import EpisodeConfig, grid, of_seeds
from care_sim.study.play_config import PlayConfig, mechanism_plays, play_grid
from care_sim.study.rows.parameters import parameters


def play_scenes(
    options: Protocol | Mechanism | ProtocolVariants,
    study: str,
    command: str,
    source_text: str,
    plays: Callable[..., Sequence[PlayConfig]],
) -> int:
    """Play scenes of the source that is named; `plays` takes the source, scenes and policies.

    Raises InvalidInput if none of the policies can be played.
    """
    check_values(options, "policies")
    source = source_named(options, source_text)
    scenes = chosen_scenes(source.scenes(), options.scenes)
    policies, left_out = playable(options.policies, lambda name: plays(source, scenes[:1], [name]))
    configs = plays(source, scenes, policies)
    return play_study(options, study, configs, named_after(command, source_text), left_out)


def protocol(options: Protocol) -> int:
    """Play the paper's first-sighting protocol (Secs. 3 and 5)."""
    check_values(options, "budgets")
    common = _common(options, options.policies)
    latencies = take_values(options.camera_latencies, "camera_latency", common)
    # The floors of a scene have consecutive seeds, from --floor-seed on.
    first = common.pop("floor_seed")
    plays = partial(
        play_grid,
        budgets=options.budgets,
        floor_seeds=range(first, first + options.floor_seeds),
        camera_latencies=latencies,
        **common,
    )
    return play_scenes(options, "protocol", "protocol", options.source, plays)


def mechanism(options: Mechanism) -> int:
    """Say why policies differ: on one shared belief, and ray by ray."""
    driver = options.driver
    common = _common(options, (*options.policies, driver))
    plays = partial(mechanism_plays, budget=options.budget, driver=driver, **common)
    return play_scenes(options, "mechanism", "mechanism", options.source, plays)


def _common(options: Protocol | Mechanism, policies: Sequence[str]) -> dict[str, Any]:
    return common_of(options, policies) | {"presence": options.presence}


_CLOSED = ("seeds", "also", "sensors", "tables")
_OPEN = ("policies", "budgets", "floor_seeds")


def ablate(options: Ablate) -> int:
    """Vary one thing at a time."""
    options.check_loop(("seeds",), ("budgets",))
    if options.source is None:
        return fixed_study(options, "ablate", ablation_study)
    check_values(options, "budgets")
    source = source_named(options, options.source)
    scenes = chosen_scenes(quarter_of(source.scenes()), options.scenes)
    budgets = options.budgets
    # No pattern by itself: it feels none of what is varied.
    also, left_out = playable(
        options.also or (), lambda name: ablation_plays(source, scenes[:1], budgets[:1], [name]), 0
    )
    configs = ablation_plays(source, scenes, budgets, also)
    name = named_after("ablate", options.source)
    return play_study(options, "ablate-open-loop", configs, name, left_out)


def order(options: Order) -> int:
    """Play the paper's study under every order of cells in a set."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is None:
        return fixed_study(options, "order", order_study)
    return _play_variants(options, "order", options.source, order_plays)


def firing(options: Firing) -> int:
    """Play under every hardware of the LiDAR."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is None:
        check_values(options, "sensors")
        report_problems([line for sensor in options.sensors for line in fitting(sensor).left_out])
        return fixed_study(options, "firing", partial(firing_study, sensors=options.sensors))
    # Others are checked when they are played, as in every study.
    own = [name for name in options.policies if name in FIRING_POLICIES]
    fits = fitting(options.sensor or DEFAULT_SETUP, own)
    report_problems(fits.left_out)
    unfit = {*own} - {*fits.policies}
    policies = tuple(name for name in options.policies if name not in unfit)
    fitted = replace(options, policies=policies)
    return _play_variants(fitted, "firing", options.source, firing_plays)


def realism(options: Realism) -> int:
    """Play the headline tables under the conditions of a real car."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is not None:
        source = source_named(options, options.source)
        scenes = chosen_scenes(source.scenes(), options.scenes)
        told = [film_conditions(source, scenes, budget) for budget in options.budgets]
        report_problems([line for each in told for line in each.left_out])
        return _play_variants(options, "realism", options.source, realism_plays)
    check_values(options, "tables")
    known = {headline.option: headline for headline in HEADLINES}
    for name in (named := expanded(options.tables, known)):
        check_known("table", name, known)
    headlines = [headline for headline in HEADLINES if headline.option in named]
    seeds = seeds_of(options.seeds)
    also, left_out = further_policies(options)
    configs = realism_study(seeds, also, headlines)
    told = [headline_conditions(headline) for headline in headlines]
    report_problems([line for each in told for line in each.left_out])
    return play_study(options, "realism", configs, "realism", left_out)


def _play_variants(
    options: ProtocolVariants, command: str, source: str, plays: Callable[..., Sequence[PlayConfig]]
) -> int:
    """Play the protocol in all variants."""
    check_values(options, "budgets")
    floors = range(options.floor_seeds)
    made = partial(plays, budgets=options.budgets, floor_seeds=floors)
    return play_scenes(options, f"{command}-open-loop", command, source, made)


CONTROLS = ("fan",)
"""The best pattern without a camera in these scenes."""
_Configurations = Callable[[Sequence[int], Sequence[str]], Sequence[EpisodeConfig]]
"""The episodes of a study, from the seeds and the further policies."""


def further_policies(options: FixedStudy) -> tuple[list[str], list[str]]:
    """Return the policies that can be played, and a line for each that cannot."""
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
    rates = take_values(options.false_negative_rates, "false_negative_rate", common)
    latencies = take_values(options.camera_latencies, "camera_latency", common)
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
