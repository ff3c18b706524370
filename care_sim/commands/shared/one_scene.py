"""Plays of `run` and `compare`: one episode per policy, or one scene of a source that is named in
the place of a scenario.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.plugins import is_place
from care_sim.commands.options.watching import WatchOptions
from care_sim.commands.shared.selection import arguments_of
from care_sim.core.conditions import DEFAULTS, OF_BOTH_LOOPS, ClosedLoopConditions
from care_sim.reports.episodes.clips import Clip
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.feeding import source_for
from care_sim.sources.installed import SOURCES, is_source_place
from care_sim.sources.named import source_name, source_of
from care_sim.sources.recordings import Recordings
from care_sim.sources.scenes import Scene, Source, Streets
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.play_config import PlayConfig, play_grid

_STREET = "street"
"""One of the generated streets, as `CARE-Street-v0` has them; `streets` says the same."""


def is_source(text: str) -> bool:
    """Whether what is named is a source of scenes, and no scenario."""
    name = source_name(text)
    if name in (_STREET, *SOURCES.names()):
        return True
    # A scenario's message fits whatever is no source or cannot be loaded.
    return is_place(name) and is_source_place(name)


def maker_of(
    options: WatchOptions, named: str, policies: Sequence[str], budget: float
) -> Callable[[Sequence[str]], Sequence[EpisodeConfig | PlayConfig]]:
    """Return a function that makes one task for each of some `policies`: an episode of the scenario
    that is `named`, or a play of one scene of that source. Raises InvalidInput for options that the
    loop does not have.
    """
    given = arguments_of(options, policies)
    if not is_source(named):
        options.check_closed()
        return lambda names: grid([named], names, [budget], [options.seed], **given)
    sensor = given.pop("sensor")
    source = source_of(
        Streets.kind if named == _STREET else named,
        split=options.split,
        version=options.version,
        sensor=None if sensor == DEFAULT_SETUP else sensor,
        topics=options.topics or None,
    )
    if given.pop("scenario_parameters"):
        raise InvalidInput("--scenario-parameters has no meaning in the open loop")
    for field in fields(ClosedLoopConditions):
        if field.name not in OF_BOTH_LOOPS and given.pop(field.name) != DEFAULTS[field.name]:
            option = field.name.replace("_", "-")
            raise InvalidInput(f"--{option} has no meaning in the open loop")
    source = source_for(source, options.detector, given["detector_parameters"])
    floors, scene = [given.pop("floor_seed")], scene_of(options, source)
    return lambda names: play_grid(source, [scene], names, [budget], floors, **given)


def scene_of(options: WatchOptions, source: Source) -> Scene:
    """The scene that is named, or else that of the seed. Raises InvalidInput where there is
    none.
    """
    scenes = {each.name: each for each in source.scenes()}
    seed = options.seed
    if options.scene is not None:
        check_known("scene", options.scene, scenes)
    chosen = next(iter(scenes.values())) if options.scene is None else scenes[options.scene]
    # The seed of a recording draws only the faults and the floor; a street is its seed.
    kind: Any = SOURCES.maker(source.kind)
    if issubclass(kind, Recordings):
        return chosen._replace(seed=seed)
    if options.scene is not None:
        # 0 may be the seed that nobody gave.
        if seed not in (0, chosen.seed):
            told = f"{chosen.name} is that of --scene, --seed {seed} changes nothing"
            print(told, file=sys.stderr)
        return chosen
    seeds = {each.seed: each for each in scenes.values()}
    if seed in seeds:
        return seeds[seed]
    told = f"{min(seeds)} to {max(seeds)}, got {seed}"
    raise InvalidInput(f"seed must be of a scene of {source.kind}, {told}")


def finish_files(record: Path | None, film: Clip, video: Path | None) -> None:
    """Write the film, and tell of it and of the recording, where there are any."""
    if record is not None:
        print_lines(f"Recorded in {record}: care-sim view {record}")
    if film.write():
        print_lines(f"Filmed in {video}")
