"""Examples for the sets: keyframes of drives, of tests of Euro NCAP and of generated streets, or of
the scenes of a source.

Truth is used here, at training, and nowhere else.

- Worlds, budgets and faults of the camera are those of `care_sim.training.supervised.worlds`, of
  training seeds or of scenes. The policy is also drawn: another policy, or, in later rounds, this
  one with the weights of the round before. So it learns from the results of its own choice (DAgger:
  Ross, Gordon and Bagnell, A reduction of imitation learning, 2011).
- An item's label is the number of its cells, in order, after which an object in range has returned
  three times. For a track it is its own object, for a camera box an untracked object. An object in
  several boxes belongs to the box that detects it with the fewest cells.
- A strip's label is the share of a detection, 1 from three returns on, of objects that no box and
  no track would detect. An object in several strips belongs to the strip with most of its returns;
  otherwise near objects would count many times.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.cells.boxes import planar_ranges
from care_sim.evaluation.sightings import RANGE_M
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.policies.learned.learned_sets import LEARNED_RETURNS, STEPS, LearnedSets
from care_sim.policies.learned.set_items import ItemReader, Items
from care_sim.policies.learned.set_kernels import Numbers, needed_cells
from care_sim.training.supervised.worlds import AnyEnv, World, kept, keyframes, plays, present

OTHERS = ("care-spread", "care", "care-sightlines", "care-sector", "all-camera", "history-rows")
"""Other policies that play."""
OWN_SHARE = 0.6
"""Share of later rounds that this policy plays itself."""
OTHER_STRIPS = 40
"""Strips drawn per keyframe; strips with a detection are all kept."""


@dataclass(frozen=True)
class Example:
    """A keyframe. `inputs` (n, `ITEM_INPUTS`) are of its items, the first `boxes` of them camera
    boxes. `answers` (n,) are places in `STEPS`, its length for never. For some strips (s,):
    `places`, `strips` (s, `STRIP_INPUTS`), `found`, and `weights`, the number of strips that each
    represents.
    """

    inputs: Numbers
    boxes: int
    answers: NDArray[np.int8]
    places: NDArray[np.int16]
    strips: Numbers
    found: Numbers
    weights: Numbers


def play(world: World, own: Path | None, faulty: bool = True) -> list[Example]:
    """Yield the examples of a world. `own` are this policy's weights of the round before, None in
    the first. With `faulty=False` the camera has no fault.
    """
    rng = np.random.default_rng([world.seed, len(world.kind), own is not None])
    examples: list[Example] = []
    for env in plays(world, rng, faulty):
        examples += _examples(env, world, rng, own)
    return examples


def _examples(
    env: AnyEnv, world: World, rng: np.random.Generator, own: Path | None
) -> Iterator[Example]:
    policy = _player(env, rng, own)
    reader = ItemReader(env.rig, STEPS[-1])
    for belief in keyframes(env, policy, world.seed):
        if kept(env, rng, world.share):
            yield _example(env, reader, reader.of(belief), rng)


def _player(env: AnyEnv, rng: np.random.Generator, own: Path | None) -> Policy:
    if own is not None and rng.random() < OWN_SHARE:
        return make_policy(
            LearnedSets.name, env, path=own, refresh_per_s=float(rng.choice([0.1, 0.3, 1.0]))
        )
    return make_policy(str(rng.choice(OTHERS)), env)


def _example(env: AnyEnv, reader: ItemReader, items: Items, rng: np.random.Generator) -> Example:
    tracks = env.loop.belief.tracks
    objects, boxes, returning, of = present(env.loop)
    # The first return of a cell is the one that counts.
    behind = np.full(env.rig.grid.size, -1)
    behind[returning[::-1]] = of[::-1]
    in_range = planar_ranges(boxes) <= RANGE_M
    numbers = _numbered(behind, objects[in_range])
    count = int(in_range.sum())
    sets = items.sets
    needed = needed_cells(sets.cells, sets.sizes, numbers, count, LEARNED_RETURNS)
    tracked = _numbered(env.loop.true_objects(tracks), objects[in_range])
    answers = np.zeros(len(sets), np.int64)

    # A track's target is its own object.
    rows = np.flatnonzero(tracked >= 0)
    answers[items.boxes + rows] = needed[items.boxes + rows, tracked[rows]]

    # A box's target is an untracked object that no other box detects with fewer cells.
    found = needed[: items.boxes]
    open_ = ~np.isin(np.arange(count), tracked)
    cost = np.where((found > 0) & open_, found, np.inf)
    shown = np.isfinite(cost).any(axis=0) if items.boxes else np.zeros(count, bool)
    for number in np.flatnonzero(shown).tolist():
        box = int(cost[:, number].argmin())
        answers[box] = min(answers[box] or STEPS[-1], int(cost[box, number]))

    # Strips get the remaining objects.
    counts = np.bincount(numbers[numbers >= 0], minlength=count)
    left = open_ & ~shown & (counts >= LEARNED_RETURNS)
    strips = _strip_shares(reader, numbers, left)
    return Example(
        items.inputs,
        items.boxes,
        np.where(answers > 0, np.searchsorted(STEPS, answers), len(STEPS)).astype(np.int8),
        *_drawn_strips(strips, reader, items, rng),
    )


def _numbered(objects: Integers, known: Integers) -> Integers:
    """Return (n,) the places of `objects` (n,) among the known ones (k,), -1 for others."""
    if not len(known):
        return np.full(len(objects), -1)
    order = np.argsort(known)
    places = order[np.searchsorted(known, objects, sorter=order).clip(0, len(known) - 1)]
    return np.where(known[places] == objects, places, -1)


def _strip_shares(reader: ItemReader, numbers: Integers, left: NDArray[np.bool_]) -> Floats:
    """Return (S,) the share of a detection of the remaining objects (k,) per strip."""
    behind = numbers[reader.strips]
    shares = np.zeros(len(behind))
    for number in np.flatnonzero(left).tolist():
        returns = (behind == number).sum(axis=1)
        best = int(returns.argmax())
        shares[best] += min(returns[best] / LEARNED_RETURNS, 1)
    return np.minimum(shares, 1)


def _drawn_strips(
    shares: Floats, reader: ItemReader, items: Items, rng: np.random.Generator
) -> tuple[NDArray[np.int16], Numbers, Numbers, Numbers]:
    (full,) = np.nonzero(shares)
    (empty,) = np.nonzero(shares == 0)
    drawn = rng.choice(empty, min(OTHER_STRIPS, len(empty)), replace=False)
    kept = np.concatenate([full, drawn])
    each = np.concatenate([np.ones(len(full)), np.full(len(drawn), len(empty) / len(drawn))])
    return (
        reader.places[kept].astype(np.int16),
        items.strips[kept],
        shares[kept].astype(np.float32),
        each.astype(np.float32),
    )
