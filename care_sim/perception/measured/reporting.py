"""Reports of a measured detector at a keyframe, and the errors of boxes."""

import math
from typing import NamedTuple

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.hashing import mixed
from care_sim.core.arrays import Floats, Integers
from care_sim.core.rows import copy_row
from care_sim.perception.found import Found
from care_sim.perception.matching import MATCH_M
from care_sim.perception.measured.candidates import Kinds
from care_sim.perception.measured.luck import FIRST_ERROR, LUCK, TURNED, Memory, Shares, signal_of
from care_sim.perception.measured.recall import effective_returns, latent_score, score_of
from care_sim.perception.measured.tables import ERRORS, SIGNALS, WIDEST_NORMAL, Errors, Recall
from care_sim.perception.proxy import count_hits

_WIDEST_M = MATCH_M * (1 - 1e-9)
"""Largest error of a centre: slightly below MATCH_M, since rounding could push a box beyond."""
_RADIAL, _TANGENTIAL, _LENGTH, _WIDTH, _HEIGHT, _YAW = range(len(ERRORS))


class Rules(NamedTuple):
    """The fixed numbers of a detector on a rig."""

    recall: Recall
    shares: Shares
    errors: Errors
    kinds: Kinds
    weights: Floats
    """(k,) the weights of this keyframe's returns and of earlier ones, newest first."""
    angles: Floats
    """(h,) the weight of a return of each LiDAR."""
    most: float
    """Largest score that is reported."""
    kept_ahead: float
    """See `care_sim.perception.measured.tables.Measurement`."""
    sensor_height_m: float
    """Above the road."""


@compiled()
def report_objects(
    w: int,
    clock: tuple[np.uint64, int],
    present: tuple[Integers, Integers, Floats],
    returned: tuple[Integers, Integers, int],
    firsts: Integers,
    memory: Memory,
    rules: Rules,
    found: Found,
) -> None:
    """Write into `found` what is reported of the `present` objects of a world `w`: their numbers
    (n,), classes (n,), and boxes (n, 7), which get errors.

    The `clock` holds the episode's seed and the keyframe. `returned` are the ascending cells and
    the objects of all returns (P,), and the number of sweeps. `firsts` are those of a `View`.
    """
    (seed, keyframe), (objects, classes, boxes), (cells, hits, sweeps) = clock, present, returned
    table, weights, ranks = rules.recall, rules.weights, memory.ranks[w]
    ascending, by_rank = np.empty_like(objects), np.zeros(len(objects), np.int64)
    for n in range(len(objects)):
        ascending[ranks[n]] = objects[n]
    usual = np.zeros(len(objects))
    begin = 0
    for head, angle in enumerate(rules.angles):
        end = np.searchsorted(cells, firsts[head + 1])
        own = count_hits(ascending, hits[begin:end])
        by_rank += own
        usual += angle * own
        begin = end
    now_at = keyframe % len(weights)
    memory.returns[w, :, now_at] = 0.0
    signals = np.empty(len(SIGNALS))
    count = 0
    for n in range(len(objects)):
        label, row = classes[n], (w, memory.rows[w, n])
        now = usual[ranks[n]] / sweeps
        memory.returns[row][now_at] = now
        average = now if sweeps > 1 else _average(memory.returns[row], weights, keyframe)
        # Objects without returns are not reported, though the fitted curve has a share at 0.
        if not table.known[label] or now + average <= 0:
            continue
        worth = table.worth[label]
        effective = effective_returns(
            now * worth, average * worth, table.fall[label], table.most[label]
        )
        latent, key = latent_score(effective, label, table), mixed(seed, objects[n])
        luck = signal_of(key, keyframe, row, (label, LUCK), memory, rules.shares)
        score = score_of(latent.mean + latent.spread * luck, label, table, rules.most)
        if score < rules.kinds.least:
            continue
        for signal in range(TURNED, len(SIGNALS)):
            signals[signal] = signal_of(key, keyframe, row, (label, signal), memory, rules.shares)
        found.classes[w, count], found.objects[w, count] = label, objects[n]
        found.scores[w, count], found.returns[w, count] = score, by_rank[ranks[n]]
        box = found.boxes[w, count]
        copy_row(boxes[n], box)
        _misplace(box, label, max(average * worth, 1.0), signals, rules.errors)
        count += 1
    found.counts[w] = count


@compiled()
def _average(counts: Floats, weights: Floats, keyframe: int) -> float:
    """Return the object's returns per sweep. At the start there are fewer sweeps than the detector
    gathers; detectors repeat the available ones.
    """
    total, weight = 0.0, 0.0
    first = place = keyframe % len(weights)
    for age in range(min(len(weights), keyframe + 1)):
        total += weights[age] * counts[place]
        weight += weights[age]
        place = place - 1 if place > 0 else len(weights) - 1
    return total / weight if weight > 0 else counts[first]


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
