"""Recall and scores of the detector.

The chance that an object has a score of at least t is a logistic formula. It uses height in pixels,
occlusion, the share beyond the picture, shape, distance at that height, and the share that nearer
boxes cover. It is fitted at nine scores t; between them the logit is linear in that of t. One
number of luck decides both: the score is the highest t whose chance exceeds it.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats
from care_sim.core.types import CLASSES
from care_sim.sensors.kitti.numbers import CAR, FEATURES, FOCAL_PX, KIND_OF, Numbers, measured

USUAL_SHAPE = (0.5, -0.85, -0.1)
"""Logarithms of width over height of the three kinds, about which their shape is counted."""
USUAL_METRES = 1.55
"""Height of a usual car, metres. The distance of cars alone matters beyond their height."""
LEVELS = 4
"""KITTI's levels of occlusion: 0 not, 1 partly, 2 largely occluded, 3 unknown."""
_COUNT = len(FEATURES)


def recall(
    label: str,
    height_px: ArrayLike,
    occlusion: ArrayLike = 0,
    truncation: ArrayLike = 0.0,
    distance_m: ArrayLike | None = None,
    *,
    width_px: ArrayLike | None = None,
    cover: ArrayLike = 0.0,
    confidence: float = 0.25,
) -> Floats:
    """Return the chance that the detector finds objects with at least this `confidence`.

    `label` is one of the five classes. Arguments are arrays of one shape, or numbers. Heights and
    widths of the whole box are in pixels of KITTI's focal length (721.5), cut at the picture's
    edges. `occlusion` is KITTI's level, 0 to 3. `truncation` is the share of the box beyond the
    picture. Distances are planar, in metres. `cover` is the share that nearer boxes cover. A
    missing distance or width takes the usual value for the height. Beyond confidences of 0.05 and
    0.9997 the chance stays. Raises InvalidInput for other classes and levels, lengths that are not
    above 0, and shares or confidences that are not from 0 to 1.
    """
    for name, length in (
        ("height_px", height_px),
        ("width_px", 1.0 if width_px is None else width_px),
        ("distance_m", 1.0 if distance_m is None else distance_m),
    ):
        if not (np.asarray(length, float) > 0).all():
            raise InvalidInput(f"{name} must be above 0, got {shown(length)}")
    for name, share in (("truncation", truncation), ("cover", cover)):
        shares = np.asarray(share, float)
        if not ((shares >= 0) & (shares <= 1)).all():
            raise InvalidInput(f"{name} must be from 0 to 1, got {shown(share)}")
    if not 0 < confidence < 1:
        raise InvalidInput(f"confidence must be between 0 and 1, got {shown(confidence)}")
    if label not in KIND_OF:
        raise InvalidInput(f"label must be one of {', '.join(CLASSES)}, got {shown(label)}")
    levels = np.asarray(occlusion)
    if not np.isin(levels, range(LEVELS)).all():
        raise InvalidInput(f"occlusion must be 0, 1, 2 or 3, got {shown(occlusion)}")
    kind = KIND_OF[label]
    heights = np.asarray(height_px, float)
    widths = heights * np.exp(USUAL_SHAPE[kind]) if width_px is None else width_px
    # A distance of 0 stands for the usual one, as for trucks and buses at any distance.
    metres = 0.0 if distance_m is None or (kind == CAR and label != "car") else distance_m
    columns = np.broadcast_arrays(heights, widths, levels, truncation, metres, cover)
    table = np.stack([np.ravel(column).astype(float) for column in columns], axis=1)
    chances = _chances(kind, table, math.log(confidence / (1 - confidence)), measured().numbers)
    return chances.reshape(columns[0].shape)


@compiled()
def _chances(kind: int, table: Floats, logit: float, numbers: Numbers) -> Floats:
    chances = np.empty(len(table))
    for n in range(len(table)):
        height, width, level, beyond, metres, cover = table[n]
        seen = features(kind, height, width, int(level), beyond, metres, cover, numbers.knots[kind])
        logits = score_logits(numbers.recall[kind], seen)
        chances[n] = 1 / (1 + math.exp(-np.interp(logit, numbers.thresholds[:-1], logits[:-1])))
    return chances


@compiled()
def features(
    kind: int,
    height: float,
    width: float,
    level: int,
    beyond: float,
    metres: float,
    cover: float,
    knots: Floats,
) -> Floats:
    """(22,) FEATURES of an object; `metres` 0 stands for the usual distance at its height."""
    row = np.zeros(_COUNT)
    row[0] = 1.0
    _lay_height(math.log(max(height, 1e-3)), knots, row)
    shape = math.log(min(max(width / height, 0.2), 5.0)) - USUAL_SHAPE[kind]
    row[10], row[11] = beyond, beyond * beyond
    row[14], row[15] = shape, shape * shape
    row[20], row[21] = cover, cover * cover
    if level > 0:
        row[6 + level] = 1.0
    if level == 1 or level == 2:
        least, most = math.exp(knots[0]), math.exp(_last(knots))
        row[11 + level] = math.log(min(max(height, least), most) / 40)
        row[15 + level] = shape
    if metres > 0:
        apparent = min(max(metres * height / FOCAL_PX, 0.4), 3.0)
        row[18] = math.log(apparent / USUAL_METRES)
        row[19] = row[18] * row[18]
    return row


@compiled()
def _last(knots: Floats) -> float:
    last = 0
    for n in range(len(knots)):
        if knots[n] < math.inf:
            last = n
    return float(knots[last])


@compiled()
def _lay_height(height: float, knots: Floats, row: Floats) -> None:
    """Fill features 1 to 6: how near a logarithmic height is to every knot but the first."""
    height = min(max(height, knots[0]), _last(knots))
    for k in range(len(knots) - 1):
        if not height <= knots[k + 1]:
            continue
        share = (height - knots[k]) / (knots[k + 1] - knots[k])
        if k:
            row[k] = 1 - share
        row[k + 1] = share
        return


@compiled()
def score_logits(coefficients: Floats, seen: Floats) -> Floats:
    """(10,) logits of the chances to reach each threshold, which never rise with it."""
    logits = np.empty(len(coefficients) + 1)
    for t in range(len(coefficients)):
        logit = 0.0
        for k in range(len(seen)):
            logit += coefficients[t, k] * seen[k]
        logits[t] = logit if t == 0 else min(logit, logits[t - 1])
    return logits


@compiled()
def score_of(luck: float, logits: Floats, thresholds: Floats) -> float:
    """The score of an object whose luck (0 to 1, as a logit) is this; 0 if it is missed."""
    last = len(logits) - 1
    # Beyond the last threshold chances fall on as before it, at least by 0.3 per threshold.
    step = (thresholds[last] - thresholds[last - 1]) / (thresholds[last - 1] - thresholds[last - 2])
    logits[last] = logits[last - 1] + min(logits[last - 1] - logits[last - 2], -0.3) * step
    if luck > logits[0]:
        return 0.0
    for t in range(1, last + 1):
        if luck > logits[t]:
            share = (logits[t - 1] - luck) / (logits[t - 1] - logits[t])
            logit = thresholds[t - 1] + share * (thresholds[t] - thresholds[t - 1])
            return 1 / (1 + math.exp(-logit))
    return 1 / (1 + math.exp(-thresholds[last]))
