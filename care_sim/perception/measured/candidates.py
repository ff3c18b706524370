"""Candidates for false boxes, which appear, stay at one place in the world, and end.

Candidates have an even density in the whole world. They depend only on the episode's seed, the tile
and the keyframe, so every car meets the same ones at the same place and time. A part of each class
lasts (`lasting`, `lasts_s`), the rest stays for `flash_s`.

Each candidate has a rank from 0 to 1. It is a false box while its rank is below the density of its
class at its distance, divided by the highest density of the class. So the car meets the measured
density at every distance, on all sides, at any speed.
"""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed, normal, uniform
from care_sim.core.arrays import Floats, Integers
from care_sim.core.rows import copy_row
from care_sim.perception.measured.tables import Measurement

RING_M = 10.0
"""Width of a ring of distances, metres."""
REACH_M = 50.0
"""Largest distance of counted false boxes."""
TILE_M = 20.0
"""Side of a tile. Candidates are made for tiles within reach."""
LONGEST_LIVES = 20
"""Longest life in mean lives: one of 500 million candidates lasts longer."""
LABEL, X, Y, SCORE, LAST, AHEAD, RANK, KIND, SEEN = 0, 1, 2, 8, 9, 10, 11, 12, 13
"""Columns of a table of candidates (n, 20): class, world box (7) without its height above the road,
score, last keyframe, a uniform number, rank, row of `Kinds`. The last are the box (7) in the sensor
frame. A candidate may be on the road ahead if the number is below `kept_ahead`.
"""
COLUMNS = SEEN + 7

Place = tuple[float, float]
"""World x and y, metres."""
Tile = tuple[int, int]


class Kinds(NamedTuple):
    """The candidates by kind, which is a class and whether they last; k kinds."""

    labels: Integers
    means: Floats
    """(2, k) new candidates per tile: at the first keyframe, and at a later one. Cumulative over
    the kinds.
    """
    lives: Floats
    """(k,) mean lives in keyframes."""
    shares: Floats
    """(k, rings) densities by distance, as shares of the highest one."""
    scores: Floats
    """(k, m) ascending scores."""
    logs: Floats
    """(k, m) logarithm of the number of boxes from each score on; -inf where a kind has fewer
    scores.
    """
    log_sizes: Floats
    """(k, 3, 2) mean and spread of the logarithms of length, width and height."""
    least: float
    """Least score of a candidate. Every least score chooses from the same ones."""


class Candidates(NamedTuple):
    """The candidates of W worlds: `rows` (W, C, 20), of which `counts` (W,) are in use. `before`
    (W, 2) are the places of the sensors at the last keyframe, nan at the start.
    """

    counts: Integers
    rows: Floats
    before: Floats


def kinds_of(measured: Measurement, keyframe_s: float, least: float) -> Kinds:
    """Return the kinds of a detector for a keyframe length and a least score."""
    known = measured.false_boxes
    lasting = np.array([one.lasting for one in known])
    lives = np.array([one.lasts_s for one in known])
    areas = np.pi * RING_M**2 * (2 * np.arange(len(known[0].distances)) + 1)
    densities = np.array([one.distances for one in known]) / areas
    most = densities.max(axis=1)
    around = 360.0 / measured.view_deg
    means = np.array([one.rates[0, 1] for one in known]) * around * most * TILE_M**2
    # Both kinds of each class: those that last, then the others. As many are born as end.
    means = np.concatenate([means * lasting, means * (1 - lasting)])
    lives = np.concatenate([lives, np.full(len(lives), measured.flash_s)]) / keyframe_s
    ends = 1 - np.exp(-1 / np.maximum(lives, 1e-9))
    longest = max(len(one.rates) for one in known)
    table = np.full((2, len(known), longest), -np.inf)
    for row, one in enumerate(known):
        table[0, row, : len(one.rates)] = one.rates[:, 0]
        table[1, row, : len(one.rates)] = np.log(one.rates[:, 1])
    return Kinds(
        np.tile([one.label for one in known], 2).astype(np.int64),
        np.cumsum([means, means * ends], axis=1),
        lives,
        np.tile(densities / most[:, None], (2, 1)),
        np.tile(table[0], (2, 1)),
        np.tile(table[1], (2, 1)),
        np.tile(np.array([one.log_sizes for one in known]), (2, 1, 1)),
        float(least),
    )


@compiled()
def advance_candidates(
    w: int, clock: tuple[np.uint64, int], place: Place, candidates: Candidates, kinds: Kinds
) -> int:
    """Advance the candidates of a world `w` to a keyframe, within reach of a sensor at `place`. The
    `clock` holds the episode's seed and the keyframe.

    Return how many rows they need. If the table has fewer, call again with a longer one.
    """
    (seed, keyframe), rows = clock, candidates.rows[w]
    before = candidates.before[w, 0], candidates.before[w, 1]
    count = candidates.counts[w] = _keep_living(rows, candidates.counts[w], keyframe, place)
    across, along = _tiles(place[0]), _tiles(place[1])
    for i in range(across[0], across[1]):
        for j in range(along[0], along[1]):
            if _is_near((i, j), place):
                # A tile that comes within reach has had births before. Older ones have ended.
                first = keyframe
                if not _is_near((i, j), before):
                    first = max(0, keyframe - math.ceil(LONGEST_LIVES * kinds.lives.max()))
                count = _add_births(rows, count, seed, (i, j), (first, keyframe), kinds)
    if count <= len(rows):
        candidates.counts[w] = count
        candidates.before[w, 0], candidates.before[w, 1] = place
    return count


@compiled()
def _keep_living(rows: Floats, count: int, keyframe: int, place: Place) -> int:
    """Move those of the first `count` candidates to the front that live and are within reach.
    Return their number.
    """
    kept = 0
    for n in range(count):
        tile = math.floor(rows[n, X] / TILE_M), math.floor(rows[n, Y] / TILE_M)
        if rows[n, LAST] >= keyframe and _is_near(tile, place):
            copy_row(rows[n], rows[kept])
            kept += 1
    return kept


@compiled()
def _add_births(
    rows: Floats, count: int, seed: np.uint64, tile: Tile, time: tuple[int, int], kinds: Kinds
) -> int:
    """Add a tile's candidates to the `count` in a table: those born within the keyframes of `time`
    and alive at its end. Return their new number, in which those without room count too.
    """
    first, keyframe = time
    key = mixed(mixed(seed, tile[0] + 2**40), tile[1] + 2**40)
    for born in range(first, keyframe + 1):
        now = mixed(key, born)
        means = kinds.means[min(born, 1)]
        for birth in range(_poisson(uniform(now, 0), means[-1])):
            own = mixed(now, birth + 1)
            kind = np.searchsorted(means, uniform(own, 0) * means[-1])
            # The candidate stays from now on for its exponential life.
            last = born + math.floor(-kinds.lives[kind] * math.log(uniform(own, 1)))
            if last < keyframe:
                continue
            score = _score_at(kinds.scores[kind], kinds.logs[kind], uniform(own, 5))
            if score >= kinds.least:
                if count < len(rows):
                    _fill(rows[count], own, tile, kind, kinds)
                    rows[count, SCORE], rows[count, LAST] = score, last
                count += 1
    return count


@compiled()
def _tiles(along: float) -> tuple[int, int]:
    """Return the first tile within reach along an axis, and the first one beyond."""
    first, last = (along - REACH_M) / TILE_M, (along + REACH_M) / TILE_M
    return math.floor(first), math.floor(last) + 1


@compiled()
def _is_near(tile: Tile, place: Place) -> bool:
    """Whether a part of a tile is within reach of a place; False of nan."""
    x = max(tile[0] * TILE_M - place[0], place[0] - (tile[0] + 1) * TILE_M, 0.0)
    y = max(tile[1] * TILE_M - place[1], place[1] - (tile[1] + 1) * TILE_M, 0.0)
    return place[0] == place[0] and x * x + y * y <= REACH_M * REACH_M


@compiled()
def _poisson(share: float, mean: float) -> int:
    """The number of a Poisson distribution at the quantile `share`."""
    chance, count = math.exp(-mean), 0
    total = chance
    while share > total and count < 1000:
        count += 1
        chance *= mean / count
        total += chance
    return count


@compiled()
def _fill(row: Floats, key: np.uint64, tile: Tile, kind: int, kinds: Kinds) -> None:
    """Draw a candidate of a tile into its row. The numbers 0, 1 and 5 of its key draw its kind,
    life and score.
    """
    row[LABEL], row[KIND] = kinds.labels[kind], kind
    row[X] = (tile[0] + uniform(key, 2)) * TILE_M
    row[Y] = (tile[1] + uniform(key, 3)) * TILE_M
    row[3] = 0.0
    for side in range(3):
        mean, spread = kinds.log_sizes[kind, side]
        row[4 + side] = math.exp(mean + spread * normal(key, 4 + side))
    row[7] = 2 * math.pi * uniform(key, 4)
    row[RANK], row[AHEAD] = uniform(key, 6), uniform(key, 7)


@compiled()
def _score_at(scores: Floats, logs: Floats, share: float) -> float:
    """Return the score from which on there is a `share` of all boxes. Between two scores, and
    beyond the last, the logarithm of the number is linear.
    """
    wanted, place = math.log(share) + logs[0], 0
    while place + 2 < len(scores) and logs[place + 1] > wanted and logs[place + 2] > -math.inf:
        place += 1
    part = (wanted - logs[place]) / (logs[place + 1] - logs[place])
    score: float = scores[place] + part * (scores[place + 1] - scores[place])
    return score
