"""Studies that play the closed loop, or with a source of scenes the open loop."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from care_sim.base.checks import check_known
from care_sim.base.errors import report_problems
from care_sim.commands.options.shared import seeds_of
from care_sim.commands.options.studies import Ablate, Firing, Order, ProtocolVariants, Realism
from care_sim.commands.shared.play_study import play_study
from care_sim.commands.shared.selection import (
    check_values,
    expanded,
    named_after,
    playable,
    source_named,
)
from care_sim.commands.studies.closed_loop import fixed_study, further_policies
from care_sim.commands.studies.open_loop import play_scenes
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.ablations import ablation_plays, ablation_study, quarter_of
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.firing import (
    firing_plays,
    firing_study,
    fitting,
    order_plays,
    order_study,
)
from care_sim.study.designs.realism import (
    HEADLINES,
    film_conditions,
    headline_conditions,
    realism_plays,
    realism_study,
)
from care_sim.study.play_config import PlayConfig

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
