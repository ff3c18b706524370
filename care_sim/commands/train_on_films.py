"""`care-sim train learned-scorer`, `learned-sets` and `detector`: of generated worlds, or of the
scenes of a source.
"""

import shlex
from dataclasses import fields, replace
from typing import Any

from care_sim.base.errors import InvalidInput, report_problems
from care_sim.base.extras import import_torch
from care_sim.base.files import ZIP, check_output
from care_sim.commands.options.learning import TrainDetector, TrainScorer, TrainSets
from care_sim.commands.options.shared import SourceOptions
from care_sim.commands.options.studies import Protocol
from care_sim.commands.shared.command_line import command_line
from care_sim.commands.shared.selection import source_named
from care_sim.sources.installed import SOURCES
from care_sim.sources.scenes import chosen_scenes
from care_sim.training.supervised.detector import train_pillars
from care_sim.training.supervised.recorded import Scenes, parted
from care_sim.training.supervised.scorer import train_learned_scorer
from care_sim.training.supervised.sets import train_sets as train_learned_sets

Trained = TrainScorer | TrainSets | TrainDetector
PUBLISHED = {
    ("streets", "evaluation"): "the tables of generated streets",
    ("nuscenes", "val"): "the paper's tables and for detection scores",
    ("nuscenes", "mini_val"): "the tables of recorded drives",
    ("nuscenes", "all"): "the tables of recorded drives and for detection scores, in a part",
    ("argoverse2", ""): "the tables of recorded drives, in a part",
    ("kitti", ""): "the tables of recorded drives",
}
"""Purposes that the scenes of a built-in source are published for, by its kind and split. A line
without a split holds for all splits.
"""


def train_scorer(options: TrainScorer) -> int:
    """Train `learned-scorer`."""
    return train_learned_scorer(options, scenes_of(options, _policy("learned-scorer", options)))


def train_sets(options: TrainSets) -> int:
    """Train `learned-sets`."""
    return train_learned_sets(options, scenes_of(options, _policy("learned-sets", options)))


def train_detector(options: TrainDetector) -> int:
    """Train `pillars`."""
    played = {"detector": "pillars", "detector_parameters": (f"file={options.out}",)}
    return train_pillars(options, scenes_of(options, played))


def scenes_of(options: Trained, played: dict[str, Any]) -> Scenes | None:
    """Return the scenes that the options name, None for generated worlds. `played` are the options
    of `protocol` that play the weights. First checks what every training needs: PyTorch and a file
    to write.

    Raises InvalidInput for a source that cannot be read, lacks a split or has too few scenes.
    Raises InvalidInput for a scene in both parts, and for source options without a source.
    """
    options.check_source()
    # Before a source is hashed or a world is played: both take minutes.
    import_torch()
    check_output(options.out, ZIP)
    if options.source is None:
        return None
    source = source_named(options, options.source)
    if options.split is None and getattr(SOURCES.maker(source.kind), "split", None):
        raise InvalidInput(
            f"source {source.kind} has several splits: pass --split with the one to learn from"
        )
    split = options.split or ""
    scenes = chosen_scenes(source.scenes(), options.scenes)
    apart = None
    if options.validation_split is not None:
        held_out = replace(options, split=options.validation_split)
        apart = source_named(held_out, options.source).scenes()
    published = PUBLISHED.get((source.kind, split)) or PUBLISHED.get((source.kind, ""))
    if published:
        which = f"the split {split} of {source.kind}" if split else f"source {source.kind}"
        report_problems([f"{which} is published for {published}: play the weights on other scenes"])
    learned, held = parted(source, scenes, apart)
    own = {each.name: getattr(options, each.name) for each in fields(SourceOptions)}
    own |= {"split": options.validation_split or options.split}
    if apart is None:
        own["scenes"] = tuple(scene.name for scene in held)
    line = command_line(Protocol(source=options.source, **own, **played))
    splits = split, options.validation_split or split
    return Scenes(source, learned, held, splits, tuple(shlex.split(line)[1:]))


def _policy(name: str, options: TrainScorer | TrainSets) -> dict[str, Any]:
    path = f"{name}.path={options.out}"
    return {"policies": ("care", name), "policy_parameters": (path,)}
