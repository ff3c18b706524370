"""Studies that play the closed loop, or with a source of scenes the open loop."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from care_sim.base.checks import check_known
from care_sim.base.errors import report_problems
from care_sim.commands.options.further_studies import Ablate, Firing, Order, Realism
from care_sim.commands.options.shared import seeds_of
from care_sim.commands.options.studies import ProtocolVariants
from care_sim.commands.shared.play_study import play_study
from care_sim.commands.shared.selection import (
    check_values,
    expanded,
    named_after,
    playable,
    some_playable,
    source_named,
)
from care_sim.commands.studies.closed_loop import fixed_study, further_policies
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.ablations import ablation_plays, ablation_study, quarter_of
from care_sim.study.designs.defaults import FIRING_POLICIES
from care_sim.study.designs.firing import firing_plays, firing_study, fitting
from care_sim.study.designs.order import order_plays, order_study
from care_sim.study.designs.realism import (
    HEADLINES,
    Headline,
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
        return fixed_study(options, "ablate", ablation_study, "ablate")
    check_values(options, "budgets")
    source = source_named(options, options.source)
    scenes = chosen_scenes(quarter_of(source.scenes()), options.scenes)
    budgets = options.budgets
    # No pattern by itself: it feels none of what is varied.
    also, left_out = playable(
        options.also or (), lambda name: ablation_plays(source, scenes[:1], budgets[:1], [name])
    )
    configs = ablation_plays(source, scenes, budgets, also)
    name = named_after("ablate", options.source)
    return play_study(options, "ablate-open-loop", configs, name, left_out)


def order(options: Order) -> int:
    """Play the paper's study under every order of cells in a set."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is None:
        return fixed_study(options, "order", order_study, "order")
    return _play_scenes(options, "order", order_plays, options.source)


def firing(options: Firing) -> int:
    """Play under every hardware of the LiDAR."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is None:
        check_values(options, "sensors")
        report_problems([line for sensor in options.sensors for line in fitting(sensor).left_out])
        study = partial(firing_study, sensors=options.sensors)
        return fixed_study(options, "firing", study, "firing")
    # Others are checked when they are played, as in every study.
    own = [name for name in options.policies if name in FIRING_POLICIES]
    fits = fitting(options.sensor or DEFAULT_SETUP, own)
    report_problems(fits.left_out)
    unfit = {*own} - {*fits.policies}
    policies = tuple(name for name in options.policies if name not in unfit)
    fitted = replace(options, policies=policies)
    return _play_scenes(fitted, "firing", firing_plays, options.source)


def realism(options: Realism) -> int:
    """Play the headline tables under the conditions of a real car."""
    options.check_loop(_CLOSED, _OPEN)
    if options.source is not None:
        source = source_named(options, options.source)
        scenes = chosen_scenes(source.scenes(), options.scenes)
        told = [film_conditions(source, scenes, budget) for budget in options.budgets]
        report_problems([line for each in told for line in each.left_out])
        return _play_scenes(options, "realism", realism_plays, options.source)
    seeds = seeds_of(options.seeds)
    headlines = _headlines(options)
    also, left_out = further_policies(options)
    configs = realism_study(seeds, also, headlines)
    told = [headline_conditions(headline) for headline in headlines]
    report_problems([line for each in told for line in each.left_out])
    return play_study(options, "realism", configs, "realism", left_out)


def _headlines(options: Realism) -> list[Headline]:
    """Those that are named, in their order."""
    check_values(options, "tables")
    known = {headline.option: headline for headline in HEADLINES}
    named = expanded(options.tables, known)
    for name in named:
        check_known("table", name, known)
    return [headline for headline in HEADLINES if headline.option in named]


def _play_scenes(
    options: ProtocolVariants,
    command: str,
    plays: Callable[..., Sequence[PlayConfig]],
    named: str,
) -> int:
    """Play the scenes of the source that is `named`; `plays` takes the source, scenes, policies and
    budgets, and `floor_seeds` by name.

    Raises InvalidInput if none of the policies can be played.
    """
    check_values(options, "policies", "budgets")
    source = source_named(options, named)
    scenes = chosen_scenes(source.scenes(), options.scenes)
    played = partial(plays, source, floor_seeds=range(options.floor_seeds))
    policies, left_out = some_playable(
        options.policies, lambda name: played(scenes[:1], [name], options.budgets[:1])
    )
    configs = played(scenes, policies, options.budgets)
    name = named_after(command, named)
    return play_study(options, f"{command}-open-loop", configs, name, left_out)
