"""Studies of the open loop."""

from collections.abc import Sequence

from care_sim.commands.options.further_studies import Mechanism
from care_sim.commands.options.studies import Protocol
from care_sim.commands.shared.play_study import play_study
from care_sim.commands.shared.selection import (
    check_values,
    common_of,
    in_turn,
    named_after,
    playable,
    some_playable,
    source_named,
)
from care_sim.sources.scenes import Scene, chosen_scenes
from care_sim.study.mechanism_config import MechanismConfig, mechanism_plays
from care_sim.study.play_config import play_grid


def protocol(options: Protocol) -> int:
    """Play the paper's first-sighting protocol (Secs. 3 and 5)."""
    check_values(options, "policies", "budgets")
    source = source_named(options, options.source)
    common = common_of(options, options.policies) | {"presence": options.presence}
    scenes = chosen_scenes(source.scenes(), options.scenes)
    latencies = in_turn(options.camera_latencies, "camera_latency", common)
    # The floors of a scene have consecutive seeds, from --floor-seed on.
    first = common.pop("floor_seed")
    policies, left_out = some_playable(
        options.policies,
        lambda name: play_grid(source, scenes[:1], [name], options.budgets[:1], **common),
    )
    floors = range(first, first + options.floor_seeds)
    configs = play_grid(source, scenes, policies, options.budgets, floors, latencies, **common)
    name = named_after("protocol", options.source)
    return play_study(options, "protocol", configs, name, left_out)


def mechanism(options: Mechanism) -> int:
    """Say why policies differ: on one shared belief, and ray by ray."""
    source = source_named(options, options.source)
    driver = options.driver
    common = common_of(options, (*options.policies, driver)) | {"presence": options.presence}
    scenes = chosen_scenes(source.scenes(), options.scenes)

    def plays(scenes: Sequence[Scene], policies: Sequence[str]) -> list[MechanismConfig]:
        return mechanism_plays(
            source, scenes, policies, budget=options.budget, driver=driver, **common
        )

    policies, left_out = playable(options.policies, lambda name: plays(scenes[:1], [name]))
    name = named_after("mechanism", options.source)
    return play_study(options, "mechanism", plays(scenes, policies), name, left_out)
