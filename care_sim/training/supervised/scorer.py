"""Train the learned scorer: `care-sim train learned-scorer` makes the shipped weights from nothing,
`--drawn` others, from worlds that differ.

The paper names no network and no loss. Both are as plain as possible. The network has one hidden
layer of rectified units for each cell alone. The loss is the weighted logistic loss, whose best
score orders cells by their odds of detecting an object. Adam runs a fixed number of steps over
shuffled batches, its rate falling to 0 along a half cosine. With one thread and fixed seeds, the
same machine makes the same bytes.

Truth is used only here, in training. The paper only says that 20 scenes outside the evaluation
train the network. The rest was decided before a result was seen:

- An example is a cell at a keyframe. It is positive if its return of the full scan lies on an
  object that has no track and that can be detected at all, in MIN_RETURNS cells or more.
- The policy `history`, whose reserve is learned, plays the scenes at all studied budgets, so that
  one file serves them all.
- Scenes are played with all cameras and with only the front one, the closed loop's only camera.
- Drawn worlds are those of `care_sim.training.supervised.worlds`, also played by `history`. Nothing
  is mirrored: the inputs of a cell do not distinguish left from right.
- First sightings count objects, not cells, so the cells of an object weigh 1 together, however many
  they are.
- All positive cells are kept. There are sixty times as many negative cells, of which about as many
  are kept at random. Both groups have the same total weight.
"""

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.array_files import Arrays
from care_sim.base.extras import import_torch
from care_sim.base.limits import one_thread
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.arrays import Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.grid import Cells
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.policies.learned.cell_inputs import CellInputs, Float32s
from care_sim.policies.learned.weights import save_weights
from care_sim.policies.paper.tracks import History
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.sources.street_films import street_film
from care_sim.streets.street import CALIBRATION_SEEDS
from care_sim.training.supervised.fit import card_of, fit, make_adam, print_end, show_each
from care_sim.training.supervised.options import ScorerConfig
from care_sim.training.supervised.recorded import Scenes
from care_sim.training.supervised.worlds import (
    LEAST_BUDGET,
    MOST_BUDGET,
    SCENARIOS,
    AnyEnv,
    World,
    generated_worlds,
    kept,
    keyframes,
    plays,
    present,
    views_of,
)

SCORER_BUDGETS = (0.03, 0.10, 0.35)
"""The paper's smallest closed-loop budget, the budget of both loops, and its largest open-loop
budget.
"""
OTHER_CELLS = 200
"""Cells drawn per keyframe; negative ones become examples."""


@dataclass(frozen=True)
class Examples:
    """Cells to learn from."""

    inputs: Float32s
    """(n, SCAN_INPUTS + len(RIG_INPUTS))"""
    positive: Mask
    """(n,) whether an untracked object returns from each."""
    weights: Float32s
    """(n,)"""

    def __len__(self) -> int:
        return len(self.positive)


def examples(world: World) -> Iterator[Examples]:
    """Yield the examples of a seed's street, or of a source's scene, one play at a time."""
    film = world.film() if world.film else street_film(world.seed)
    for number, (shown, budget) in enumerate(product(views_of(film), SCORER_BUDGETS)):
        rng = np.random.default_rng([world.seed, number])
        if parts := [*_play(FilmEnv(shown, budget=budget), world, rng)]:
            yield _joined(parts)


def drawn_examples(world: World) -> Iterator[Examples]:
    """Yield the examples of a world under drawn budgets and faults, one keyframe at a time."""
    rng = np.random.default_rng([world.seed, len(world.kind)])
    for env in plays(world, rng):
        yield from _play(env, world, rng, thinned=True)


def balanced(parts: Iterable[Examples]) -> Examples:
    """Join all parts; positive and negative examples have equal total weight, 1 per example on
    average.
    """
    together = _joined([*parts])
    # In float64: millions of weights are summed. Each group then weighs half of the total.
    weights = together.weights.astype(np.float64)
    for group in (together.positive, ~together.positive):
        weights[group] *= len(weights) / 2 / max(weights[group].sum(), 1e-12)
    return replace(together, weights=weights.astype(np.float32))


def untracked_cells(loop: OpenLoop | OneWorld) -> tuple[Cells, Float32s]:
    """Return the cells (n,) of the next keyframe that should fire, and their weights (n,). Truth.
    In the full scan they have a return from a detectable object in range without a track.
    """
    objects, boxes, returning, behind = present(loop)
    in_range = planar_ranges(boxes) <= RANGE_M
    tracked = np.isin(objects, loop.true_objects(loop.belief.tracks))
    wanted = np.isin(behind, objects[in_range & ~tracked])
    # Each cell once, for the object of its first return: returns of a recorded sweep may share a
    # cell.
    cells, first = np.unique(returning[wanted], return_index=True)
    # `sizes` (objects,) counts the cells of an object; `group` (cells,) maps cells to `sizes`.
    # Fewer than MIN_RETURNS would not detect the object.
    _, group, sizes = np.unique(behind[wanted][first], return_inverse=True, return_counts=True)
    enough = sizes[group] >= MIN_RETURNS
    return cells[enough], (1 / sizes[group[enough]]).astype(np.float32)


def _play(
    env: AnyEnv, world: World, rng: np.random.Generator, thinned: bool = False
) -> Iterator[Examples]:
    inputs = CellInputs(env.rig)
    for belief in keyframes(env, History(env.rig), world.seed):
        if kept(env, rng, world.share) if thinned else _in_share(world, rng):
            yield _keyframe(env.loop, belief, inputs, rng)


def _in_share(world: World, rng: np.random.Generator) -> bool:
    return world.share == 1 or bool(rng.random() < world.share)


def _keyframe(
    loop: OpenLoop | OneWorld, belief: Belief, inputs: CellInputs, rng: np.random.Generator
) -> Examples:
    positive, shares = untracked_cells(loop)
    # Drawn from all cells, not only from negative ones: few cells are positive.
    others = np.setdiff1d(rng.choice(inputs.rig.grid.size, OTHER_CELLS, replace=False), positive)
    cells = np.concatenate([positive, others])
    seen = inputs.of(belief, inputs.rig.hulls(belief.tracks.boxes))
    weights = np.concatenate([shares, np.ones(len(others), np.float32)])
    return Examples(
        np.hstack([seen.rows(cells), inputs.rig_inputs[cells]]),
        np.arange(len(cells)) < len(positive),
        weights,
    )


def _joined(parts: list[Examples]) -> Examples:
    return Examples(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Examples)
        )
    )


HIDDEN_UNITS = 16
"""Hidden units: as many as score a keyframe within half a millisecond on one core."""
BATCH = 4096
"""Cells per gradient."""
STREETS: Mapping[str, tuple[int, ...]] = {
    "calibration": CALIBRATION_SEEDS,
    "held out": tuple(range(2000, 2004)),
}
"""Seeds of training streets, and of streets outside calibration and evaluation. The card holds the
loss on both.
"""
DRAWN: Mapping[str, tuple[int, Mapping[str, int]]] = {
    "learned": (TRAINING, {"drive": 48, "ncap": 144, "street": 8}),
    "held out": (VALIDATION, {"drive": 6, "ncap": 18, "street": 1}),
}
"""With `--drawn`, the first seed and the number of worlds of each kind: about 6,500 training
keyframes, 2,560 of them of streets.
"""


def train_learned_scorer(config: ScorerConfig, scenes: Scenes | None = None) -> int:
    """Train the policy, on `scenes` if given, write its weights, and return the exit code of the
    command.
    """
    started = time.perf_counter()
    worlds, told = _lessons(config.drawn, scenes)
    made = drawn_examples if config.drawn else examples
    data = {
        name: balanced(part for world in show_each(own, f"{name} world") for part in made(world))
        for name, own in worlds.items()
    }
    arrays, losses = train_scorer(data, config.seed, config.steps)
    learned = next(iter(data.values()))
    cells = f"{len(learned)} cells, {int(learned.positive.sum())} of them positive, of "
    card = card_of(
        "learned-scorer",
        sensor=told["sensor"],
        scenario=told["scenario"],
        data=f"{cells}{told['data']}; {OTHER_CELLS} others per keyframe{told['terms']}",
        seeds=told["seeds"] | {"training": config.seed},
        steps=config.steps,
        result={f"loss {name}": round(loss, 5) for name, loss in losses.items()},
    )
    save_weights(config.out, arrays, card)
    print_end(config.out, started, card.result, scenes, "run", str(config.out))
    return 0


def train_scorer(
    data: Mapping[str, Examples], seed: int, steps: int
) -> tuple[Arrays, dict[str, float]]:
    """Train on the first set of examples. Returns the weights, and the loss on every set (log 2 =
    0.69 without any knowledge).
    """
    torch = import_torch()
    learned = next(iter(data.values()))
    with one_thread(torch):
        torch.manual_seed(seed)
        network = torch.nn.Sequential(
            torch.nn.Linear(learned.inputs.shape[1], HIDDEN_UNITS),
            torch.nn.ReLU(),
            torch.nn.Linear(HIDDEN_UNITS, 1, bias=False),
        )
        batches = _batches(np.random.default_rng(seed), len(learned))
        fit(
            partial(_loss, network, learned), batches, steps, make_adam(network.parameters(), steps)
        )
        with torch.no_grad():
            losses = {
                name: float(_loss(network, cells, np.arange(len(cells))))
                for name, cells in data.items()
            }
    # PyTorch holds (units, inputs); the policy multiplies inputs (n, inputs) from the left.
    layer, bias, out = (parameter.detach().numpy() for parameter in network.parameters())
    return {"layer": layer.T, "bias": bias, "out": out[0]}, losses


def _batches(rng: np.random.Generator, count: int) -> Iterator[NDArray[np.int64]]:
    """Yield endless batches of rows (n,). Each pass over the examples is in random order; an
    incomplete last batch is left out.
    """
    size = min(BATCH, count)
    order = np.empty(0, np.int64)
    while True:
        if len(order) < size:
            order = rng.permutation(count)
        batch, order = np.split(order, [size])
        yield batch


def _loss(network: Any, data: Examples, rows: NDArray[np.int64]) -> Any:
    """Return the weighted logistic loss over some examples."""
    torch = import_torch()
    inputs, positive, weights = (
        torch.from_numpy(column[rows]) for column in (data.inputs, data.positive, data.weights)
    )
    scores = network(inputs)[:, 0]
    # With logits: the logarithm of a sigmoid that underflows would be minus infinity.
    return torch.nn.functional.binary_cross_entropy_with_logits(scores, positive.float(), weights)


_PLAYED = f"under history at {', '.join(f'{one:g}' for one in SCORER_BUDGETS)} of the cells"
_DRAWN_PLAYED = (
    f"under history at {LEAST_BUDGET:g} to {MOST_BUDGET:g} of the cells, with faults of the camera"
)


def _lessons(drawn: bool, scenes: Scenes | None) -> tuple[dict[str, list[World]], dict[str, Any]]:
    """Return training and held-out worlds, by the name of the part, and their description for the
    card.
    """
    if scenes:
        worlds = {
            "learned": scenes.worlds(scenes.learned),
            "held out": scenes.worlds(scenes.held_out),
        }
        told = scenes.told["data"] + "; " + (_DRAWN_PLAYED if drawn else _PLAYED)
        return worlds, scenes.told | {"data": told}
    generated = {"sensor": DEFAULT_SETUP, "terms": ""}
    if not drawn:
        worlds = {name: [World("street", seed) for seed in own] for name, own in STREETS.items()}
        return worlds, generated | {
            "scenario": "CARE-Street-v0",
            "data": f"generated streets {_PLAYED}, with six cameras and with the front one",
            "seeds": {name: list(seeds) for name, seeds in STREETS.items()},
        }
    learned = ", ".join(f"{count} of {kind}" for kind, count in DRAWN["learned"][1].items())
    worlds = {name: generated_worlds(own, first) for name, (first, own) in DRAWN.items()}
    return worlds, generated | {
        "scenario": SCENARIOS,
        "data": f"worlds {learned} {_DRAWN_PLAYED}, streets with six cameras and with the front "
        "one",
        "seeds": {
            name: [first, first + max(counts.values()) - 1]
            for name, (first, counts) in DRAWN.items()
        },
    }
