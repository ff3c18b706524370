"""Train the policy `learned-sets`: `care-sim train learned-sets` makes the shipped weights from
nothing.

Two rounds: in the first somebody else's policies play, in the second mostly this one with what the
first has taught it, and it learns anew from the keyframes of both. One thread and fixed seeds: the
same machine makes the same bytes.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from care_sim.base.errors import print_lines
from care_sim.base.extras import import_torch
from care_sim.base.files import ZIP, check_output
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.policies.learned.learned_sets import LearnedSets
from care_sim.policies.learned.set_items import ItemReader
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.study.provenance import machine_line, package_versions
from care_sim.training.closing import how_to_play
from care_sim.training.drawn_worlds import SCENARIOS, seeds_of_worlds
from care_sim.training.sets_data import Example, play
from care_sim.training.sets_network import learn, losses_of
from care_sim.training.weights_config import SetsConfig

ROUNDS: tuple[Mapping[str, int], ...] = (
    {"drive": 24, "ncap": 48, "street": 10},
    {"drive": 48, "ncap": 96, "street": 20},
)
"""How many worlds of each kind are played in each round."""
HELD_OUT: Mapping[str, int] = {"drive": 4, "ncap": 8, "street": 2}
"""Worlds of validation seeds, played as in the second round; the card tells the loss on them."""


def train_sets(config: SetsConfig) -> int:
    """Train the policy and write its weights; returns the exit code of the command."""
    import_torch()
    check_output(config.out, ZIP)
    started = time.perf_counter()
    places = place_count()
    examples: list[Example] = []
    first = TRAINING
    rounds = 0
    # Whatever ends the learning, what the rounds before have taught is in the file.
    try:
        for worlds in ROUNDS:
            own = config.out if rounds else None
            examples += gathered(worlds, first, own, "faults" not in config.without)
            first += max(worlds.values())
            arrays = learn(examples, places, config.seed, config.steps, config.without)
            rounds += 1
            save_weights(config.out, arrays, _card(config, examples, ROUNDS[:rounds]))
        held_out = gathered(HELD_OUT, VALIDATION, config.out)
    except BaseException:
        if rounds:
            told = f"{config.out} holds what {rounds} of {len(ROUNDS)} rounds have taught"
            print_lines(told, file=sys.stderr)
        raise
    losses = {
        f"loss per {what}, {name}": loss
        for name, data in (("learned", examples), ("held out", held_out))
        for what, loss in losses_of(arrays, data).items()
    }
    save_weights(config.out, arrays, _card(config, examples, ROUNDS, losses))
    told = ", ".join(f"{name} {loss:.4f}" for name, loss in losses.items())
    took = f"{time.perf_counter() - started:.0f} s"
    print_lines(f"{config.out}: {told}; {took}", how_to_play("run", config.out))
    return 0


def place_count() -> int:
    """How many places of strips there are on the paper's grid."""
    return int(ItemReader(Rig(), 1).places.max()) + 1


def gathered(
    worlds: Mapping[str, int], first: int, own: Path | None, faulty: bool = True
) -> list[Example]:
    """The keyframes of so many worlds of each kind, with seeds from the first on."""
    examples: list[Example] = []
    for kind, seed in seeds_of_worlds(worlds, first):
        examples += play(kind, seed, own, faulty)
    return examples


def _card(
    made: SetsConfig,
    examples: Sequence[Example],
    rounds: Sequence[Mapping[str, int]],
    losses: Mapping[str, float] | None = None,
) -> Card:
    played = ", then ".join(
        ", ".join(f"{count} of {kind}" for kind, count in worlds.items()) for worlds in rounds
    )
    items = sum(len(one.answers) for one in examples)
    last = TRAINING + sum(max(worlds.values()) for worlds in rounds) - 1
    return Card(
        LearnedSets.name,
        AngularGrid(),
        setup=sensor_setup(DEFAULT_SETUP).label,
        scenario=SCENARIOS,
        data=f"{items} boxes and tracks of {len(examples)} keyframes; worlds {played}"
        + (", the second time mostly by itself" if len(rounds) > 1 else "")
        + (f"; without {' and '.join(made.without)}" if made.without else ""),
        seeds={"worlds": [TRAINING, last], "training": made.seed},
        steps=made.steps,
        machine=machine_line(),
        versions=package_versions("care-sim", "numpy", "torch"),
        result={name: round(loss, 5) for name, loss in (losses or {}).items()},
    )
