"""Parts that every training on truth shares: its options, the loop over batches, the card and the
last lines.
"""

import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.extras import import_torch
from care_sim.policies.learned.weights import Card
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.study.progress import rounded_duration, shown_progress
from care_sim.study.provenance import machine_line, package_versions
from care_sim.training.supervised.recorded import Scenes

_Batch = TypeVar("_Batch")
_Thing = TypeVar("_Thing")

LEARNING_RATE = 3e-3
"""Rate of Adam at the first step."""
LATELY = 250
"""Steps over which the shown loss is averaged."""


def make_adam(parameters: Iterable[Any], steps: int) -> tuple[Any, Any]:
    """Return Adam with a rate that falls to 0 along a half cosine over this many steps."""
    optim = import_torch().optim
    optimizer = optim.Adam(parameters, lr=LEARNING_RATE)
    return optimizer, optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)


def fit(
    loss: Callable[[_Batch], Any],
    batches: Iterable[_Batch],
    steps: int,
    descent: tuple[Any, Any],
    after: Callable[[list[float]], None] = lambda _losses: None,
) -> list[float]:
    """Run the optimizer of a `descent`, with its schedule, for this many steps, one per batch.

    Returns the loss of every step; `after` is called with the losses so far after each step. Call
    it in `one_thread`: the same machine then makes the same bytes. Raises InvalidInput if the loss
    is not finite.
    """
    torch = import_torch()
    optimizer, schedule = descent
    losses: list[float] = []
    started = time.monotonic()
    with shown_progress(steps, "steps") as show:
        for step, batch in zip(range(1, steps + 1), batches, strict=False):
            optimizer.zero_grad()
            off = loss(batch)
            # Later steps would not be finite either.
            if not torch.isfinite(off):
                raise InvalidInput(
                    f"the training diverged: the loss of step {step} is {off.item()}; another "
                    "--seed may do better"
                )
            off.backward()
            optimizer.step()
            schedule.step()
            losses.append(off.item())
            left = rounded_duration((time.monotonic() - started) / step * (steps - step))
            show(step, f"loss {np.mean(losses[-LATELY:]):.3f}, {left} left")
            after(losses)
    return losses


def show_each(things: Sequence[_Thing], what: str) -> Iterator[_Thing]:
    """Yield all items and show the progress on stderr."""
    for number, thing in enumerate(things, 1):
        print(f"{what} {number} of {len(things)}", end="   \r", file=sys.stderr, flush=True)
        yield thing


def card_of(kind: str, library: str = "torch", sensor: Sensor = DEFAULT_SETUP, **told: Any) -> Card:
    """Return the card of a new file for the grid of a sensor set-up, by default the paper's."""
    setup = sensor_setup(sensor)
    return Card(
        kind,
        setup.grid,
        setup=setup.label,
        machine=machine_line(),
        versions=package_versions("care-sim", "numpy", library),
        **told,
    )


def print_end(
    out: Path, started: float, result: Mapping[str, float], scenes: Scenes | None, *play: str
) -> None:
    """Print the result since `started`, and the command that plays the weights: that of the
    `scenes`, or the words `play`.
    """
    told = ", ".join(f"{name} {value:.4g}" for name, value in result.items())
    print_lines(
        f"{out}: {told}; {time.perf_counter() - started:.0f} s",
        f"play it: {shlex.join(['care-sim', *(scenes.play if scenes else play)])}",
    )
