"""What the learned scorer learns from: cells of the calibration's streets or of worlds that differ.

Truth is used here, at training, and nowhere else.

The paper says that 20 scenes apart from the evaluation's train it, and no more. The rest was
decided before a result was seen:

- An example is a cell at a keyframe. It is positive if its return of the full scan lies on an
  object that has no track and that can be detected at all, in MIN_RETURNS cells or more.
- The scenes are played by `history`, the policy whose reserve is learned, at budgets from the
  scarcest to the most generous that are studied, so that one file serves them all.
- They are played with all cameras and with the front one alone: the closed loop has no other.
- Worlds that differ are those of `care_sim.training.drawn_worlds`, and `history` plays them, too.
  Nothing is mirrored: the inputs of a cell do not tell left from right.
- First sightings count objects, not cells, so the cells of an object weigh 1 together, however many
  they are.
- All positive cells are kept. Of the others, of which there are sixty times as many, about as many
  are kept at random. They weigh together what the positive ones do, so that neither drowns the
  other.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from care_sim.core.arrays import Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.grid import Cells
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.open_loop import OpenLoop
from care_sim.policies.learned.cell_inputs import CellInputs, Float32s
from care_sim.policies.paper.tracks import History
from care_sim.sources.street_films import street_film
from care_sim.training.drawn_worlds import (
    AnyEnv,
    front_alone,
    kept,
    keyframes,
    plays,
    present,
)

SCORER_BUDGETS = (0.03, 0.10, 0.35)
"""The paper's scarcest closed loop, the budget that both loops share, and its most generous open
loop.
"""
OTHER_CELLS = 200
"""Cells drawn per keyframe; those that are not positive are kept as examples."""


@dataclass(frozen=True)
class Examples:
    """Cells to learn from."""

    inputs: Float32s
    """(n, SCAN_INPUTS + len(RIG_INPUTS))"""
    positive: Mask
    """(n,) whether an untracked object returns from them."""
    weights: Float32s
    """(n,)"""

    def __len__(self) -> int:
        return len(self.positive)


def examples(seeds: Iterable[int]) -> Iterator[Examples]:
    """The examples of the streets of some seeds, one play at a time."""
    for seed in seeds:
        film = street_film(seed)
        for number, (shown, budget) in enumerate(
            (shown, b) for shown in (film, front_alone(film)) for b in SCORER_BUDGETS
        ):
            rng = np.random.default_rng([seed, number])
            yield _joined([*_play(FilmEnv(shown, budget=budget), seed, rng)])


def drawn_examples(kind: str, seed: int) -> Iterator[Examples]:
    """The examples of the street, the drive or the test of a seed, one keyframe at a time."""
    rng = np.random.default_rng([seed, len(kind)])
    for env in plays(kind, seed, rng):
        yield from _play(env, seed, rng, thinned=True)


def balanced(parts: Iterable[Examples]) -> Examples:
    """All parts as one, positive and other examples of equal weight, 1 on average."""
    together = _joined([*parts])
    # In float64: millions of weights are summed. Each group then weighs half of the total.
    weights = together.weights.astype(np.float64)
    for group in (together.positive, ~together.positive):
        weights[group] *= len(weights) / 2 / max(weights[group].sum(), 1e-12)
    return replace(together, weights=weights.astype(np.float32))


def untracked_cells(loop: OpenLoop | ClosedLoop) -> tuple[Cells, Float32s]:
    """Cells (n,) of the coming keyframe that should fire, and what each weighs (n,). Truth.

    In the full scan they have a return from an object in range that has no track and can be
    detected.
    """
    objects, boxes, returning, behind = present(loop)
    in_range = planar_ranges(boxes) <= RANGE_M
    tracked = np.isin(objects, loop.true_objects(loop.belief.tracks))
    wanted = np.isin(behind, objects[in_range & ~tracked])
    # Each cell once, for the object of its first return: those of a recorded sweep may share one.
    cells, first = np.unique(returning[wanted], return_index=True)
    # `sizes` (objects,): how many of the cells an object has; `group` (cells,): a cell's place in
    # it. Fewer than MIN_RETURNS would not detect the object.
    _, group, sizes = np.unique(behind[wanted][first], return_inverse=True, return_counts=True)
    enough = sizes[group] >= MIN_RETURNS
    return cells[enough], (1 / sizes[group[enough]]).astype(np.float32)


def _play(
    env: AnyEnv, seed: int, rng: np.random.Generator, thinned: bool = False
) -> Iterator[Examples]:
    inputs = CellInputs(env.rig)
    for belief in keyframes(env, History(env.rig), seed):
        if not thinned or kept(env, rng):
            yield _keyframe(env.loop, belief, inputs, rng)


def _keyframe(
    loop: OpenLoop | ClosedLoop, belief: Belief, inputs: CellInputs, rng: np.random.Generator
) -> Examples:
    positive, shares = untracked_cells(loop)
    # Drawn from all cells and not from the others alone: a few of so many are positive.
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
