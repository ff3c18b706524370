"""The network of `care_sim.policies.learned.set_network` in PyTorch, and how it learns.

What it says of an item is a share for each number of cells after which it is found, and one for
never: cross-entropy. What it says of a strip is a chance: logistic loss, against the share of a
detection. Both are proper, so that chances are chances, which the choice of cells relies on.
"""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from care_sim.base.array_files import Arrays
from care_sim.base.extras import import_torch
from care_sim.base.limits import one_thread
from care_sim.policies.learned.set_items import ITEM_INPUTS, MIRRORED, STRIP_INPUTS
from care_sim.policies.learned.set_network import STEPS
from care_sim.training.set_ablations import kept_weights
from care_sim.training.sets_data import Example

UNITS, WIDTH, STRIP_UNITS = 48, 16, 16
KEYFRAMES = 64
"""Per gradient."""
LEARNING_RATE = 3e-3
"""Of Adam, at the first step."""
RARE = 0.001
"""About the chance of a strip, from which the map begins."""


def learn(
    examples: Sequence[Example],
    places: int,
    seed: int,
    steps: int,
    without: Collection[str] = (),
) -> Arrays:
    """The weights, after so many steps over shuffled batches; one thread. `without` is what is left
    out (`care_sim.training.set_ablations`).
    """
    torch = import_torch()
    with one_thread(torch):
        torch.manual_seed(seed)
        arrays = _first_weights(torch, places)
        _leave_out(torch, arrays, without)
        optimizer = torch.optim.Adam(arrays.values(), lr=LEARNING_RATE)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
        rng = np.random.default_rng(seed)
        for _ in range(steps):
            rows = rng.integers(0, len(examples), KEYFRAMES)
            # Left and right are exchanged in half of them.
            signs = np.where(rng.random(KEYFRAMES) < 0.5, 1.0, -1.0)
            optimizer.zero_grad()
            sum(_losses(torch, arrays, [examples[row] for row in rows], signs)).backward()
            optimizer.step()
            schedule.step()
        return {name: array.detach().numpy() for name, array in arrays.items()}


def losses_of(arrays: Arrays, examples: Sequence[Example]) -> dict[str, float]:
    """The loss per item and per strip."""
    torch = import_torch()
    with one_thread(torch), torch.no_grad():
        held = {name: torch.from_numpy(np.asarray(array)) for name, array in arrays.items()}
        both = [
            [float(loss) for loss in _losses(torch, held, examples[first : first + 64])]
            for first in range(0, len(examples), 64)
        ]
    items, strips = np.mean(both, axis=0)
    return {"items": float(items), "strips": float(strips)}


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
    """What is not kept becomes 0 and gets no gradient; a map without places is one number."""
    for name, told in kept_weights(without).items():
        mask = torch.from_numpy(told)
        arrays[name].data *= mask
        arrays[name].register_hook(mask.mul)
    if "place" in without:
        # All places begin alike and get the same gradient, so that they stay alike.
        arrays["map"].register_hook(lambda gradient: gradient.sum().expand_as(gradient))


def _losses(
    torch: Any, arrays: dict[str, Any], batch: Sequence[Example], signs: Any = None
) -> tuple[Any, Any]:
    """The mean loss of the items of a batch, and that of its strips."""
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
    # Padding is attended by nobody; a large finite number, since a keyframe may be all padding.
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
