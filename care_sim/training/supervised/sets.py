"""Train the policy `learned-sets`: `care-sim train learned-sets` makes the shipped weights from
nothing.

There are two rounds. Other policies play the first; in the second mostly this policy plays, with
the weights of the first. It then learns anew from the keyframes of both. With one thread and fixed
seeds, the same machine makes the same bytes.

An item's output is a share for each number of cells after which it is detected, and one for never
(cross-entropy). A strip's output is a chance (logistic loss against the share of a detection). Both
losses are proper, so that outputs are true chances, which the choice of cells needs.

It can be trained without a part, to measure that part's worth:

| without | removed part |
|---|---|
| `attention` | an item's inputs from other items |
| `inputs` | all inputs of an item but its kind, and of a strip but its place |
| `place` | the map of the strips: one chance for all places |
| `faults` | camera faults in the training worlds |

A kind is an explained camera box, an unexplained one, or a track. So without `attention`, `inputs`
and `place` only constants are learned: for each kind the shares of items detected after each number
of cells, and one chance for all strips. This control measures the worth of learning beside the
choice of cells, which stays.

Removed weights stay 0; those of the map learn as one. So the file has the usual form.
"""

import sys
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.array_files import Arrays
from care_sim.base.errors import print_lines
from care_sim.base.extras import import_torch
from care_sim.base.limits import one_thread
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.rig import Rig
from care_sim.policies.learned.learned_sets import STEPS, LearnedSets
from care_sim.policies.learned.set_items import ITEM_INPUTS, MIRRORED, STRIP_INPUTS, ItemReader
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.training.supervised.fit import card_of, fit, make_adam, print_end, show_each
from care_sim.training.supervised.options import SetsConfig
from care_sim.training.supervised.recorded import Scenes
from care_sim.training.supervised.sets_data import Example, play
from care_sim.training.supervised.worlds import SCENARIOS, World, generated_worlds

KIND = ("is a camera box", "explained")
"""The inputs of an item's kind."""
UNITS, WIDTH, STRIP_UNITS = 48, 16, 16
KEYFRAMES = 64
"""Items per gradient."""
RARE = 0.001
"""Typical chance of a strip, the initial value of the map."""
ROUNDS: tuple[Mapping[str, int], ...] = (
    {"drive": 24, "ncap": 48, "street": 10},
    {"drive": 48, "ncap": 96, "street": 20},
)
"""Number of worlds of each kind in each round."""
HELD_OUT: Mapping[str, int] = {"drive": 4, "ncap": 8, "street": 2}
"""Worlds of validation seeds, played as in the second round; the card holds the loss on them."""


def train_sets(config: SetsConfig, scenes: Scenes | None = None) -> int:
    """Train the policy, on `scenes` if given, write its weights, and return the exit code of the
    command.
    """
    started = time.perf_counter()
    rig = Rig(sensor_setup(scenes.source.sensor).grid) if scenes else Rig()
    places = int(ItemReader(rig, 1).places.max()) + 1
    rounds, apart = _worlds(scenes)
    examples: list[Example] = []
    for number, worlds in enumerate(rounds, 1):
        own = config.out if number > 1 else None
        examples += gathered(worlds, own, "faults" not in config.without)
        arrays = learn(examples, places, config.seed, config.steps, config.without)
        save_weights(config.out, arrays, _card(config, scenes, examples, number))
        told = f"{config.out} holds what {number} of {len(ROUNDS)} rounds have taught"
        print_lines(told, file=sys.stderr)
    held_out = gathered(apart, config.out)
    losses = {
        f"loss per {what}, {name}": round(loss, 5)
        for name, data in (("learned", examples), ("held out", held_out))
        for what, loss in losses_of(arrays, data).items()
    }
    save_weights(config.out, arrays, _card(config, scenes, examples, len(ROUNDS), losses))
    print_end(config.out, started, losses, scenes, "run", str(config.out))
    return 0


def _worlds(scenes: Scenes | None) -> tuple[list[list[World]], list[World]]:
    """Return the worlds of every round, and held-out ones. Generated worlds never repeat; scenes
    repeat with other budgets, faults and policies.
    """
    if scenes:
        return [scenes.worlds(scenes.learned)] * len(ROUNDS), scenes.worlds(scenes.held_out)
    firsts = accumulate((max(worlds.values()) for worlds in ROUNDS[:-1]), initial=TRAINING)
    rounds = [generated_worlds(*one) for one in zip(ROUNDS, firsts, strict=True)]
    return rounds, generated_worlds(HELD_OUT, VALIDATION)


def gathered(worlds: Sequence[World], own: Path | None, faulty: bool = True) -> list[Example]:
    """Return the keyframes of worlds."""
    return [example for world in show_each(worlds, "world") for example in play(world, own, faulty)]


def learn(
    examples: Sequence[Example],
    places: int,
    seed: int,
    steps: int,
    without: Collection[str] = (),
) -> Arrays:
    """Return the weights after this many steps over shuffled batches, `without` the omitted
    parts.
    """
    torch = import_torch()
    with one_thread(torch):
        torch.manual_seed(seed)
        arrays = _first_weights(torch, places)
        _leave_out(torch, arrays, without)
        batches = _batches(examples, np.random.default_rng(seed))
        fit(
            lambda batch: sum(_losses(torch, arrays, *batch)),
            batches,
            steps,
            make_adam(arrays.values(), steps),
        )
        return {name: array.detach().numpy() for name, array in arrays.items()}


def losses_of(arrays: Arrays, examples: Sequence[Example]) -> dict[str, float]:
    """Return the loss per item and per strip."""
    torch = import_torch()
    with one_thread(torch), torch.no_grad():
        held = {name: torch.from_numpy(np.asarray(array)) for name, array in arrays.items()}
        both = [
            [float(loss) for loss in _losses(torch, held, examples[first : first + KEYFRAMES])]
            for first in range(0, len(examples), KEYFRAMES)
        ]
    items, strips = np.mean(both, axis=0)
    return {"items": float(items), "strips": float(strips)}


def _batches(
    examples: Sequence[Example], rng: np.random.Generator
) -> Iterator[tuple[list[Example], Any]]:
    """Yield drawn examples, with 1 or -1 for each: left and right are exchanged in half of them."""
    while True:
        rows = rng.integers(0, len(examples), KEYFRAMES)
        yield [examples[row] for row in rows], np.where(rng.random(KEYFRAMES) < 0.5, 1.0, -1.0)


def _first_weights(torch: Any, places: int) -> dict[str, Any]:
    def layer(inputs: int, outputs: int) -> Any:
        return torch.randn(inputs, outputs) * (1.0 / inputs) ** 0.5

    items, strips, answers = len(ITEM_INPUTS), len(STRIP_INPUTS), len(STEPS) + 1
    arrays = {
        "first": layer(items, UNITS),
        "first_bias": torch.zeros(UNITS),
        "query": layer(UNITS, WIDTH),
        "key": layer(UNITS, WIDTH),
        "value": layer(UNITS, UNITS),
        "second": layer(2 * UNITS, UNITS),
        "second_bias": torch.zeros(UNITS),
        "out": layer(UNITS, answers),
        "out_bias": torch.zeros(answers),
        "map": torch.full((places,), float(np.log(RARE))),
        "strip": layer(strips, STRIP_UNITS),
        "strip_bias": torch.zeros(STRIP_UNITS),
        "strip_out": torch.zeros(STRIP_UNITS),
    }
    return {name: array.requires_grad_() for name, array in arrays.items()}


def _leave_out(torch: Any, arrays: dict[str, Any], without: Collection[str]) -> None:
    """Set omitted weights to 0, without a gradient; a map without places is one number."""
    kept: Arrays = {}
    if "attention" in without:
        kept["value"] = np.zeros(1, np.float32)
    if "inputs" in without:
        kept["first"] = np.isin(ITEM_INPUTS, KIND).astype(np.float32)[:, None]
        kept["strip"] = np.zeros((len(STRIP_INPUTS), 1), np.float32)
    for name, told in kept.items():
        mask = torch.from_numpy(told)
        arrays[name].data *= mask
        arrays[name].register_hook(mask.mul)
    if "place" in without:
        # All places begin alike and get the same gradient, so that they stay alike.
        arrays["map"].register_hook(lambda gradient: gradient.sum().expand_as(gradient))


def _losses(
    torch: Any, arrays: dict[str, Any], batch: Sequence[Example], signs: Any = None
) -> tuple[Any, Any]:
    """Return the mean loss of the items of a batch, and of its strips."""
    nets = torch.nn.functional
    most = max(max(len(one.answers) for one in batch), 1)
    inputs = np.zeros((len(batch), most, len(ITEM_INPUTS)), np.float32)
    answers = np.full((len(batch), most), -1, np.int64)
    for row, one in enumerate(batch):
        inputs[row, : len(one.answers)] = one.inputs
        answers[row, : len(one.answers)] = one.answers
    if signs is not None:
        inputs[..., MIRRORED] *= signs[:, None, None]
    there = torch.from_numpy(answers >= 0)
    units = nets.relu(torch.from_numpy(inputs) @ arrays["first"] + arrays["first_bias"])
    scores = (units @ arrays["query"]) @ (units @ arrays["key"]).transpose(1, 2) / WIDTH**0.5
    # No item attends to padding. The number is large but finite, since a keyframe may be all
    # padding.
    told = nets.softmax(scores.masked_fill(~there[:, None], -1e9), -1) @ (units @ arrays["value"])
    both = torch.cat([units, told], -1)
    units = nets.relu(both @ arrays["second"] + arrays["second_bias"])
    logits = units @ arrays["out"] + arrays["out_bias"]
    known = torch.from_numpy(answers)[there]
    items = nets.cross_entropy(logits[there], known) if len(known) else logits.sum() * 0

    columns = (
        np.concatenate([getattr(one, name) for one in batch])
        for name in ("places", "strips", "found", "weights")
    )
    places, strips, found, weights = map(torch.from_numpy, columns)
    units = nets.relu(strips @ arrays["strip"] + arrays["strip_bias"])
    logits = units @ arrays["strip_out"] + arrays["map"][places.long()]
    loss = nets.binary_cross_entropy_with_logits(logits, found, weights, reduction="sum")
    return items, loss / weights.sum()


def _card(
    made: SetsConfig,
    scenes: Scenes | None,
    examples: Sequence[Example],
    rounds: int,
    losses: Mapping[str, float] | None = None,
) -> Card:
    """Return the card after this many rounds."""
    items = sum(len(one.answers) for one in examples)
    told = scenes.told if scenes else _generated(ROUNDS[:rounds])
    return card_of(
        LearnedSets.name,
        sensor=told["sensor"],
        scenario=told["scenario"],
        data=f"{items} boxes and tracks of {len(examples)} keyframes; {told['data']}"
        + ("; played twice" if scenes and rounds > 1 else "")
        + (", the second time mostly by itself" if rounds > 1 else "")
        + (f"; without {' and '.join(made.without)}" if made.without else "")
        + told["terms"],
        seeds=told["seeds"] | {"training": made.seed},
        steps=made.steps,
        result=losses or {},
    )


def _generated(rounds: Sequence[Mapping[str, int]]) -> dict[str, Any]:
    """Return the part of a card about generated worlds."""
    played = ", then ".join(
        ", ".join(f"{count} of {kind}" for kind, count in worlds.items()) for worlds in rounds
    )
    last = TRAINING + sum(max(worlds.values()) for worlds in rounds) - 1
    return {
        "sensor": DEFAULT_SETUP,
        "scenario": SCENARIOS,
        "data": f"worlds {played}",
        "seeds": {"worlds": [TRAINING, last]},
        "terms": "",
    }
