"""Make the map of the control `tuned-place`: repeatedly add the cell that detects most.

The map is tuned to the counts that compare allocators: newcomers that emerge and that enter,
objects kept, people kept. It shows what a fixed pattern without a camera can reach.
"""

import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.files import ZIP, check_output
from care_sim.base.seeds import TRAINING
from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.evaluation.chances import measured_rule
from care_sim.evaluation.counts import PEOPLE, SCENE_COUNTS, rows_of_newcomers
from care_sim.evaluation.sightings import Sightings
from care_sim.evaluation.smallest_budget import ENOUGH
from care_sim.loops.film import Film
from care_sim.perception.measured.recall import FIRST_HIT
from care_sim.policies.learned.weights import save_weights
from care_sim.sources.street_films import street_film
from care_sim.training.supervised.fit import card_of, print_end, show_each
from care_sim.training.supervised.options import TunedPlaceConfig

DETECTOR = "centerpoint"
"""The detector whose recall values returns."""
MOST_SHARE = 0.35
"""Share of the cells in tuned order; the others follow in the order of `rows`. No compared budget
is larger than 20%.
"""
MOST_RETURNS = 256
"""Largest number of returns that counts."""
_PEOPLE = [CLASSES.index(name) for name in PEOPLE]


class Frames(NamedTuple):
    """Objects at keyframes (o,). The cells (c,) that return from each are concatenated, with
    `sizes` (o,). Each object has a row in the table of chances and `counts` (o, 4).
    """

    cells: Integers
    sizes: Integers
    chances: Integers
    counts: Floats


def train_tuned_place(config: TunedPlaceConfig) -> int:
    """Make and write the map, and return the exit code of the command."""
    check_output(config.out, ZIP)
    started = time.perf_counter()
    seeds = show_each(range(TRAINING, TRAINING + config.streets), "training street")
    frames = joined(frames_of(street_film(seed)) for seed in seeds)
    shares = write_map(
        config.out,
        frames,
        scenario="CARE-Street-v0",
        data=f"{len(frames.sizes)} objects at keyframes, tuned to four counts",
        seeds={"train": [TRAINING, TRAINING + config.streets - 1]},
    )
    reached = {f"{name} at 10%": share for name, share in zip(SCENE_COUNTS, shares, strict=True)}
    print_end(config.out, started, reached, None, "run", str(config.out))
    return 0


def write_map(path: Path, frames: Frames, **card: Any) -> Floats:
    """Write a map tuned to the objects, with a `card` that describes them. Return the shares (4,)
    of the grid's first tenth.
    """
    grid = AngularGrid()
    order, shares = tuned_order(frames, chance_table(), grid.size)
    worth = np.zeros(grid.size, np.float32)
    worth[order] = np.arange(len(order), 0, -1)
    save_weights(path, {"sightings": worth.reshape(grid.shape)}, card_of("place", **card))
    return shares


def frames_of(film: Film) -> Frames:
    """Return the objects of a film within the scored range, at every keyframe."""
    annotated = [shot.annotations for shot in film.shots]
    sightings = Sightings.of(film.name, annotated, hidden=film.hidden)
    table = sightings.frames
    is_new = np.zeros(len(table), bool)
    is_new[sightings.events] = True
    newcomers = [is_new & own for own in rows_of_newcomers(sightings).values()]
    people = np.isin(table.classes, _PEOPLE)
    counts = np.stack([*newcomers, np.ones(len(table)), people], axis=1).astype(float)
    cells = [*_cells_by_row(film, table.keyframes, table.objects)]
    sizes = np.array([len(own) for own in cells], np.int64)
    joined_cells = np.concatenate([np.empty(0, np.int64), *cells])
    return Frames(joined_cells, sizes, 2 * table.classes + is_new, counts)


def _cells_by_row(film: Film, keyframes: Integers, objects: Integers) -> Iterator[Integers]:
    """Return the cells that return from each object at its keyframe; `keyframes` ascend."""
    for keyframe, shot in enumerate(film.shots):
        cloud = shot.cloud.to_shots()
        for number in objects[keyframes == keyframe]:
            yield np.unique(cloud.cells[cloud.objects == number])


def joined(parts: Iterable[Frames]) -> Frames:
    """Join the objects of all parts."""
    return Frames(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def chance_table() -> Floats:
    """Return (2 * classes, MOST_RETURNS + 1) the detection chance of an object of a class with 0,
    1, 2, ... returns: seen before, and in its first keyframe.
    """
    rule, returns = measured_rule(DETECTOR, {}), np.arange(MOST_RETURNS + 1.0)
    table = np.zeros((2 * len(CLASSES), len(returns)))
    for label, name in enumerate(CLASSES):
        table[2 * label] = rule(name, returns, returns)
        table[2 * label + 1] = rule(name, returns, FIRST_HIT * returns)
    return table


def tuned_order(frames: Frames, chances: Floats, size: int) -> tuple[Integers, Floats]:
    """Order the cells of a grid of `size` cells greedily, and return the shares (4,) of the grid's
    first tenth. Each cell adds most to the four counts, which are shares of a full scan's, up to
    `ENOUGH`.
    """
    full = np.array(
        [
            frames.counts[:, n] @ chances[frames.chances, np.minimum(frames.sizes, MOST_RETURNS)]
            for n in range(frames.counts.shape[1])
        ]
    )
    # A count that is 0 for a full scan has no weight.
    weights = np.divide(1.0, full, out=np.zeros_like(full), where=full > 0)
    hits = _Hits.of(frames, size)
    most = round(MOST_SHARE * size)
    order, shares = _greedy(hits, frames.chances, chances, frames.counts * weights, most)
    return order, shares[min(round(0.1 * size), most) - 1]


class _Hits(NamedTuple):
    """Returns by object and by cell: object o has cells[starts[o] : starts[o + 1]], cell c has
    owners[bounds[c] : bounds[c + 1]].
    """

    cells: Integers
    starts: Integers
    owners: Integers
    bounds: Integers

    @classmethod
    def of(cls, frames: Frames, size: int) -> "_Hits":
        owners = np.repeat(np.arange(len(frames.sizes)), frames.sizes)
        by_cell = np.argsort(frames.cells, kind="stable")
        bounds = np.searchsorted(frames.cells[by_cell], np.arange(size + 1))
        starts = np.concatenate([[0], np.cumsum(frames.sizes)])
        return cls(frames.cells, starts, owners[by_cell], bounds)


@compiled()
def _greedy(
    hits: _Hits, rows: Integers, chances: Floats, counts: Floats, most: int
) -> tuple[Integers, Floats]:
    """Return the first `most` cells in order, and the shares (most, 4) of the counts after each."""
    returns = np.zeros(len(rows), np.int64)
    wanted = np.ones(counts.shape[1])
    order = np.empty(most, np.int64)
    shares = np.zeros((most, len(wanted)))
    reached = np.zeros(len(wanted))
    worth = _worth(hits, rows, chances, counts @ wanted, returns)
    is_there = counts.sum(axis=0) > 0
    has_enough = False
    for n in range(most):
        order[n] = best = worth.argmax()
        for place in range(hits.bounds[best], hits.bounds[best + 1]):
            o = hits.owners[place]
            gain, further = _gains(chances[rows[o]], returns[o])
            returns[o] += 1
            reached += gain * counts[o]
            change = (further - gain) * (counts[o] @ wanted)
            for other in range(hits.starts[o], hits.starts[o + 1]):
                worth[hits.cells[other]] += change
        worth[best] = -np.inf
        shares[n] = reached

        # A count that has enough is ignored. Once every count has enough, the rest of the map adds
        # to all of them.
        still = (reached < ENOUGH) & is_there
        if not has_enough and (still != (wanted > 0)).any():
            has_enough = not still.any()
            wanted = np.ones(len(wanted)) if has_enough else still.astype(np.float64)
            anew = _worth(hits, rows, chances, counts @ wanted, returns)
            worth = np.where(worth > -np.inf, anew, worth)
    return order, shares


@compiled()
def _worth(
    hits: _Hits, rows: Integers, chances: Floats, weights: Floats, returns: Integers
) -> Floats:
    """Return (N,) the gain of one more return in each cell, for objects (o,) with `weights` and
    `returns` so far.
    """
    worth = np.zeros(len(hits.bounds) - 1)
    for o in range(len(rows)):
        gain, _ = _gains(chances[rows[o]], returns[o])
        for place in range(hits.starts[o], hits.starts[o + 1]):
            worth[hits.cells[place]] += gain * weights[o]
    return worth


@compiled()
def _gains(chances: Floats, returns: int) -> tuple[float, float]:
    """Return how much the next return, and the one after it, adds to the chance of an object."""
    last = len(chances) - 1
    one, two, three = min(returns, last), min(returns + 1, last), min(returns + 2, last)
    return chances[two] - chances[one], chances[three] - chances[two]
