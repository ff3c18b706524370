"""What the learned scorer learns from: cells of the calibration's streets.

Truth is used here, at training, and nowhere else.

The paper says that 20 scenes apart from the evaluation's train it, and no more. The rest was
decided before a result was seen:

- An example is a cell at a keyframe. It is positive if its return of the full scan lies on an
  object that has no track and that can be detected at all, in MIN_RETURNS cells or more.
- The scenes are played by `history`, the policy whose reserve is learned, at budgets from the
  scarcest to the most generous that are studied, so that one file serves them all.
- They are played with all cameras and with the front one alone: the closed loop has no other.
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
from care_sim.core.boxes import planar_ranges
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.grid import Cells
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film import Film, Shot
from care_sim.loops.open_loop import OpenLoop
from care_sim.policies.learned.cell_inputs import CellInputs, Float32s
from care_sim.policies.paper.history import History
from care_sim.sources.street_films import street_film

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


def balanced(plays: Iterable[Examples]) -> Examples:
    """All plays as one, positive and other examples of equal weight, 1 on average."""
    together = _joined([*plays])
    # In float64: millions of weights are summed. Each group then weighs half of the total.
    weights = together.weights.astype(np.float64)
    for group in (together.positive, ~together.positive):
        weights[group] *= len(weights) / 2 / max(weights[group].sum(), 1e-12)
    return replace(together, weights=weights.astype(np.float32))


def front_alone(film: Film) -> Film:
    """The film as a car with its first camera alone would have it."""
    return replace(film, cameras=film.cameras[:1], shots=tuple(map(_first_camera, film.shots)))


def untracked_cells(loop: OpenLoop) -> tuple[Cells, Float32s]:
    """Cells (n,) of the coming keyframe that should fire, and what each weighs (n,). Truth.

    In the full scan they have a return from an object in range that has no track and can be
    detected.
    """
    cloud = loop.shot.cloud.to_shots()
    annotations = loop.shot.annotations
    in_range = planar_ranges(annotations.boxes) <= RANGE_M
    tracked = np.isin(annotations.objects, loop.true_objects(loop.belief.tracks))
    wanted = np.isin(cloud.objects, annotations.objects[in_range & ~tracked])
    # Each cell once, for the object of its first return: those of a recorded sweep may share one.
    cells, first = np.unique(cloud.cells[wanted], return_index=True)
    # `sizes` (objects,): how many of the cells an object has; `group` (cells,): a cell's place in
    # it. Fewer than MIN_RETURNS would not detect the object.
    _, group, sizes = np.unique(
        cloud.objects[wanted][first], return_inverse=True, return_counts=True
    )
    enough = sizes[group] >= MIN_RETURNS
    return cells[enough], (1 / sizes[group[enough]]).astype(np.float32)


def _play(env: FilmEnv, seed: int, rng: np.random.Generator) -> Iterator[Examples]:
    policy = History(env.rig)
    inputs = CellInputs(env.rig)
    observation, _ = env.reset(seed=seed)
    while not env.loop.over:
        yield _keyframe(env.loop, Belief.from_observation(observation), inputs, rng)
        observation, *_ = env.step(policy(observation))


def _keyframe(
    loop: OpenLoop, belief: Belief, inputs: CellInputs, rng: np.random.Generator
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


def _first_camera(shot: Shot) -> Shot:
    seen = shot.seen
    rows = np.flatnonzero(seen.detections.cameras == 0)
    columns = {
        field.name: getattr(seen.detections, field.name)[rows] for field in fields(seen.detections)
    }
    front = replace(
        seen, detections=replace(seen.detections, **columns), objects=seen.objects[rows]
    )
    return replace(shot, seen=front)


def _joined(parts: list[Examples]) -> Examples:
    return Examples(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Examples)
        )
    )
