"""Reports of a measured detector at a keyframe, and the errors of boxes."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers
from care_sim.perception.matching import MATCH_M
from care_sim.perception.measured.luck import (
    FIRST_ERROR,
    LUCK,
    TURNED,
    Memory,
    Shares,
    signal_of,
)
from care_sim.perception.measured.recall import effective_returns, latent_score, score_of
from care_sim.perception.measured.tables import ERRORS, SIGNALS, WIDEST_NORMAL, Errors, Recall
from care_sim.perception.proxy import count_hits

_WIDEST_M = MATCH_M * (1 - 1e-9)
"""Largest error of a centre: slightly below MATCH_M, since rounding could push a box beyond."""
_RADIAL, _TANGENTIAL, _LENGTH, _WIDTH, _HEIGHT, _YAW = range(len(ERRORS))


@compiled()
def report_objects(
    clock: tuple[np.uint64, int],
    present: tuple[Integers, Integers, Integers],
    boxes: Floats,
    returned: tuple[Integers, Integers, Integers, int],
    heads: tuple[Integers, Floats],
    memory: Memory,
    gathered: tuple[Floats, Floats],
    tables: tuple[Recall, Shares, Errors],
    bounds: tuple[float, float],
) -> tuple[Integers, Floats, Floats, Integers]:
    """Return the rows (k,) of the reported `present` objects, their boxes (k, 7) with errors,
    scores (k,) within `bounds` and returns (k,).

    The `clock` holds the episode's seed and the keyframe. `present` are numbers, classes and rows
    of memory (n,) of objects with `boxes` (n, 7). `returned` are the objects of all returns (P,),
    the present ones in ascending order, the place of each in it, and the number of sweeps. The
    bounds (h + 1,) in `heads` split the returns by LiDAR, and the angles (h,) weigh them.
    `gathered` are returns (m, k) at the last keyframes, in the column of the keyframe modulo k, and
    their weights (k,), newest first.
    """
    (seed, keyframe), (objects, classes, places) = clock, present
    hits, ascending, ranks, sweeps = returned
    (counts, weights), (table, shares, errors) = gathered, tables
    by_rank, usual = np.zeros(len(ascending), np.int64), np.zeros(len(ascending))
    for head, angle in enumerate(heads[1]):
        own = count_hits(ascending, hits[heads[0][head] : heads[0][head + 1]])
        by_rank += own
        usual += angle * own
    kept = len(weights)
    counts[:, keyframe % kept] = 0.0
    rows = np.empty(len(objects), np.int64)
    seen, scores = np.empty((len(objects), 7)), np.empty(len(objects))
    returns = np.empty(len(objects), np.int64)
    signals = np.empty(len(SIGNALS))
    count = 0
    for n in range(len(objects)):
        label, place = classes[n], places[n]
        now = usual[ranks[n]] / sweeps
        counts[place, keyframe % kept] = now
        average = now if sweeps > 1 else _average(counts[place], weights, keyframe)
        # Objects without returns are not reported, though the fitted curve has a share at 0.
        if not table.known[label] or now + average <= 0:
            continue
        worth = table.worth[label]
        effective = effective_returns(
            now * worth, average * worth, table.fall[label], table.most[label]
        )
        latent = latent_score(effective, label, table)
        luck = signal_of(seed, keyframe, objects[n], place, (label, LUCK), memory, shares)
        score = score_of(latent.mean + latent.spread * luck, label, table, bounds[1])
        if score < bounds[0]:
            continue
        for signal in range(TURNED, len(SIGNALS)):
            own_place = label, signal
            signals[signal] = signal_of(
                seed, keyframe, objects[n], place, own_place, memory, shares
            )
        rows[count], scores[count], returns[count] = n, score, by_rank[ranks[n]]
        seen[count] = boxes[n]
        _misplace(seen[count], label, max(average * worth, 1.0), signals, errors)
        count += 1
    return rows[:count], seen[:count], scores[:count], returns[:count]


@compiled()
def _average(counts: Floats, weights: Floats, keyframe: int) -> float:
    """Return the object's returns per sweep. At the start there are fewer sweeps than the detector
    gathers; detectors repeat the available ones.
    """
    total, weight = 0.0, 0.0
    for age in range(min(len(weights), keyframe + 1)):
        total += weights[age] * counts[(keyframe - age) % len(weights)]
        weight += weights[age]
    return total / weight if weight > 0 else counts[keyframe % len(weights)]


@compiled()
def _at_normal(normal: float, quantiles: Floats) -> float:
    """Return the quantile at a standard normal, from quantiles at the evenly spaced `NORMALS`."""
    steps = len(quantiles) - 1
    place = (normal + WIDEST_NORMAL) / (2 * WIDEST_NORMAL) * steps
    place = min(max(place, 0.0), float(steps))
    first = min(int(place), steps - 1)
    quantile: float = quantiles[first] + (place - first) * (quantiles[first + 1] - quantiles[first])
    return quantile


@compiled()
def _misplace(box: Floats, label: int, returns: float, signals: Floats, table: Errors) -> None:
    """Add the errors of its `signals` to a box (7,) of an object with this many `returns`."""
    errors = np.empty(len(ERRORS))
    for place in range(len(ERRORS)):
        errors[place] = _at_normal(signals[FIRST_ERROR + place], table.quantiles[label, place])

    # Errors were measured of boxes within 2 m of their objects.
    radial = errors[_RADIAL] * returns ** table.powers[label, 0]
    across = errors[_TANGENTIAL] * returns ** table.powers[label, 1]
    size = math.hypot(radial, across)
    if size > _WIDEST_M:
        radial, across = radial * _WIDEST_M / size, across * _WIDEST_M / size
    away = max(math.hypot(box[0], box[1]), 1e-6)
    cos, sin = box[0] / away, box[1] / away
    box[0] += cos * radial - sin * across
    box[1] += sin * radial + cos * across

    # A box stays on the ground.
    box[2] -= box[5] / 2
    box[3] *= math.exp(errors[_LENGTH])
    box[4] *= math.exp(errors[_WIDTH])
    box[5] *= math.exp(errors[_HEIGHT])
    box[2] += box[5] / 2
    box[6] += min(max(errors[_YAW], -math.pi / 2), math.pi / 2)
    if signals[TURNED] < table.turned_below[label]:
        box[6] += math.pi
