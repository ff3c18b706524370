"""Train the learned scorer: `care-sim train learned-scorer` makes the shipped weights from nothing,
`--drawn` others, from worlds that differ.

The paper names no network and no loss. Both are the plainest that do: one hidden layer of rectified
units for every cell by itself, and the weighted logistic loss of `care_sim.training.scorer_data`,
whose best score orders the cells by the odds that they find an object. Adam runs a fixed number of
steps over shuffled batches, its rate falling to 0 along a half cosine. One thread and fixed seeds:
the same machine makes the same bytes.
"""

import sys
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.array_files import Arrays
from care_sim.base.errors import print_lines
from care_sim.base.extras import import_torch
from care_sim.base.files import ZIP, check_output
from care_sim.base.limits import one_thread
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.grid import AngularGrid
from care_sim.policies.learned.weights import Card, save_weights
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.streets.street import CALIBRATION_SEEDS
from care_sim.study.provenance import machine_line, package_versions
from care_sim.training.closing import how_to_play
from care_sim.training.drawn_worlds import (
    LEAST_BUDGET,
    MOST_BUDGET,
    SCENARIOS,
    seeds_of_worlds,
)
from care_sim.training.scorer_data import (
    OTHER_CELLS,
    SCORER_BUDGETS,
    Examples,
    balanced,
    drawn_examples,
    examples,
)
from care_sim.training.weights_config import ScorerConfig

HIDDEN_UNITS = 16
"""As many as score a keyframe within half a millisecond on one core."""
BATCH = 4096
"""Cells per gradient."""
LEARNING_RATE = 3e-3
"""Of Adam, at the first step."""
HELD_OUT = tuple(range(2000, 2004))
"""Streets that belong neither to the calibration nor to the evaluation. The card tells the loss on
them.
"""
DRAWN: Mapping[str, int] = {"drive": 48, "ncap": 144, "street": 8}
"""Worlds of training seeds with `--drawn`: about 6,500 keyframes, 2,560 of them of streets."""
DRAWN_HELD_OUT: Mapping[str, int] = {"drive": 6, "ncap": 18, "street": 1}
"""Worlds of validation seeds, for the loss that the card tells."""


def train_learned_scorer(config: ScorerConfig) -> int:
    """Train the policy and write its weights; returns the exit code of the command."""
    import_torch()
    check_output(config.out, ZIP)
    started = time.perf_counter()
    data = _drawn() if config.drawn else _streets()
    arrays, losses = train_scorer(data, config.seed, config.steps)
    save_weights(config.out, arrays, _card(config, next(iter(data.values())), losses))
    told = ", ".join(f"{name} {loss:.4f}" for name, loss in losses.items())
    took = f"{time.perf_counter() - started:.0f} s"
    print_lines(f"{config.out}: loss {told}; {took}", how_to_play("run", config.out))
    return 0


_STREETS = {"calibration": CALIBRATION_SEEDS, "held out": HELD_OUT}


def train_scorer(
    data: Mapping[str, Examples], seed: int, steps: int
) -> tuple[Arrays, dict[str, float]]:
    """The weights that the first set of examples teaches, and the loss on every set (log 2 = 0.69
    without any knowledge).
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
        _descend(torch, network, learned, np.random.default_rng(seed), steps)
        losses = {name: _loss_of(torch, network, cells) for name, cells in data.items()}
    # PyTorch holds (units, inputs); the policy multiplies inputs (n, inputs) from the left.
    layer, bias, out = (parameter.detach().numpy() for parameter in network.parameters())
    return {"layer": layer.T, "bias": bias, "out": out[0]}, losses


def _descend(
    torch: Any, network: Any, learned: Examples, rng: np.random.Generator, steps: int
) -> None:
    optimizer = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for rows in _batches(rng, len(learned), steps):
        optimizer.zero_grad()
        _loss(torch, network, learned, rows).backward()
        optimizer.step()
        schedule.step()


def _batches(rng: np.random.Generator, count: int, steps: int) -> Iterator[NDArray[np.int64]]:
    """Rows (n,) of `steps` batches.

    Each pass over the examples is in random order; what does not fill a batch at its end is left
    out.
    """
    size = min(BATCH, count)
    order = np.empty(0, np.int64)
    for _ in range(steps):
        if len(order) < size:
            order = rng.permutation(count)
        batch, order = np.split(order, [size])
        yield batch


def _loss(torch: Any, network: Any, data: Examples, rows: NDArray[np.int64]) -> Any:
    """The weighted logistic loss over some examples."""
    inputs, positive, weights = (
        torch.from_numpy(column[rows]) for column in (data.inputs, data.positive, data.weights)
    )
    scores = network(inputs)[:, 0]
    # With logits: the logarithm of a sigmoid that underflows would be minus infinity.
    return torch.nn.functional.binary_cross_entropy_with_logits(scores, positive.float(), weights)


def _loss_of(torch: Any, network: Any, data: Examples) -> float:
    with torch.no_grad():
        return float(_loss(torch, network, data, np.arange(len(data))))


def _streets() -> dict[str, Examples]:
    return {name: _gathered(name, seeds) for name, seeds in _STREETS.items()}


def _gathered(name: str, seeds: tuple[int, ...]) -> Examples:
    plays: list[Examples] = []
    for number, seed in enumerate(seeds, 1):
        print(f"{name} street {number} of {len(seeds)}", end="\r", file=sys.stderr, flush=True)
        plays += examples([seed])
    return balanced(plays)


def _drawn() -> dict[str, Examples]:
    return {
        name: balanced(
            part
            for kind, seed in seeds_of_worlds(worlds, first)
            for part in drawn_examples(kind, seed)
        )
        for name, (worlds, first) in _drawn_worlds().items()
    }


def _drawn_worlds() -> dict[str, tuple[Mapping[str, int], int]]:
    return {"learned": (DRAWN, TRAINING), "held out": (DRAWN_HELD_OUT, VALIDATION)}


def _card(made: ScorerConfig, learned: Examples, losses: dict[str, float]) -> Card:
    positive = int(learned.positive.sum())
    scenario, of, seeds = _told_of_drawn() if made.drawn else _told_of_streets()
    return Card(
        "learned-scorer",
        AngularGrid(),
        setup=sensor_setup(DEFAULT_SETUP).label,
        scenario=scenario,
        data=f"{len(learned)} cells, {positive} of them positive, of {of}; "
        f"{OTHER_CELLS} others per keyframe",
        seeds=seeds | {"training": made.seed},
        steps=made.steps,
        machine=machine_line(),
        versions=package_versions("care-sim", "numpy", "torch"),
        result={f"loss {name}": round(loss, 5) for name, loss in losses.items()},
    )


def _told_of_streets() -> tuple[str, str, dict[str, Any]]:
    budgets = ", ".join(f"{budget:g}" for budget in SCORER_BUDGETS)
    return (
        "CARE-Street-v0",
        f"generated streets under history at {budgets} of the cells, with six cameras and with the "
        "front one",
        {name: list(seeds) for name, seeds in _STREETS.items()},
    )


def _told_of_drawn() -> tuple[str, str, dict[str, Any]]:
    worlds = ", ".join(f"{count} of {kind}" for kind, count in DRAWN.items())
    return (
        SCENARIOS,
        f"worlds {worlds} under history at {LEAST_BUDGET:g} to {MOST_BUDGET:g} of the cells, with "
        "faults of the camera, streets with six cameras and with the front one",
        {
            name: [first, first + max(worlds.values()) - 1]
            for name, (worlds, first) in _drawn_worlds().items()
        },
    )
