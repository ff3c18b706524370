"""Studies of the open loop."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from care_sim.commands.options.studies import Mechanism, Protocol, ProtocolVariants
from care_sim.commands.shared.play_study import play_study
from care_sim.commands.shared.selection import (
    check_values,
    common_of,
    in_turn,
    named_after,
    playable,
    source_named,
)
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.play_config import PlayConfig, mechanism_plays, play_grid


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
    latencies = in_turn(options.camera_latencies, "camera_latency", common)
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
