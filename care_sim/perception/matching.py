"""Match detections to annotated objects: same class, centres within 2 m (paper, Remark 1)."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.types import Detections
from care_sim.sensors.annotated import Annotations

MATCH_M = 2.0
"""Greatest planar distance between the centres of an object and of its detection, this value
included.
"""
UNSERVED = -1
"""Place for an object without a detection."""


def found_objects(annotations: Annotations, detections: Detections) -> Mask:
    """Return (n,) whether each annotated object has a detection of its class within 2 m, in the
    plane (`served_by`).
    """
    found: Mask = served_by(annotations, detections) != UNSERVED
    return found


def served_by(annotations: Annotations, detections: Detections) -> Integers:
    """Return (n,) the detection matched to each annotated object, or UNSERVED. A match has the same
    class and is within 2 m in the plane.

    A detection matches one object. Detections without scores match as many objects as possible,
    with the least sum of distances. Detections with scores choose in descending order of score,
    each the nearest free object, as in the official nuScenes evaluation. Objects of all ranges take
    part, so that a detection of an object beyond the scored range does not count for a neighbour
    within it.

    Raises InvalidInput for detections whose columns do not fit together or are not finite.
    """
    _check(detections)
    scores = detections.scores
    if scores is not None:
        # Stable, so that of equally sure detections the first reported chooses first.
        return _by_score(
            np.ascontiguousarray(annotations.boxes, float),
            annotations.classes,
            np.ascontiguousarray(detections.boxes, float),
            detections.classes,
            np.argsort(-scores, kind="stable"),
        )
    objects, servers = _optimal(_distances(annotations, detections))
    result = np.full(len(annotations), UNSERVED)
    result[objects] = servers
    return result


def _distances(annotations: Annotations, detections: Detections) -> Floats:
    """(n, m) planar metres between the centres, inf where the pair is no match."""
    from scipy.spatial.distance import cdist

    distances = cdist(annotations.boxes[:, :2], detections.boxes[:, :2])
    matching = (distances <= MATCH_M) & (annotations.classes[:, None] == detections.classes)
    return np.where(matching, distances, np.inf)


def _optimal(distances: Floats) -> tuple[Integers, Integers]:
    """Return matched objects and their detections."""
    from scipy.optimize import linear_sum_assignment

    near = np.isfinite(distances)
    # Objects and detections without any match are left out first: the assignment grows with the
    # third power of their number.
    rows, columns = (np.flatnonzero(near.any(axis=axis)) for axis in (1, 0))
    distances = distances[rows][:, columns]

    # A pair that is no match costs more than all matches together. So an assignment of the least
    # cost serves as many objects as possible, and among such it has the least sum of distances.
    worse_than_all = MATCH_M * (min(distances.shape) + 1)
    served, by = linear_sum_assignment(np.minimum(distances, worse_than_all))
    matched = np.isfinite(distances[served, by])
    return rows[served[matched]], columns[by[matched]]


@compiled()
def _by_score(
    objects: Floats, classes: Integers, boxes: Floats, reported: Integers, order: Integers
) -> Integers:
    """Return (n,) the detection matched to each of `objects` (n, 7) of `classes` (n,), or UNSERVED.
    `boxes` (m, 7) of the classes `reported` (m,) choose in this `order` (m,).
    """
    result = np.full(len(objects), UNSERVED)
    for detection in order:
        chosen, least = UNSERVED, MATCH_M
        for row in range(len(objects)):
            if result[row] == UNSERVED and classes[row] == reported[detection]:
                x = objects[row, 0] - boxes[detection, 0]
                y = objects[row, 1] - boxes[detection, 1]
                away = math.sqrt(x * x + y * y)
                # Takes the first of equally near objects.
                if away < least or (away == least and chosen == UNSERVED):
                    chosen, least = row, away
        if chosen != UNSERVED:
            result[chosen] = detection
    return result


def _check(detections: Detections) -> None:
    count = len(detections)
    scores = detections.scores
    if detections.boxes.shape != (count, 7) or (scores is not None and scores.shape != (count,)):
        shapes = f"boxes {detections.boxes.shape}" + (
            "" if scores is None else f", scores {scores.shape}"
        )
        raise InvalidInput(
            f"{count} detections must have boxes ({count}, 7) and a score each, if any; "
            f"got {shapes}"
        )
    if not (
        np.all(np.isfinite(detections.boxes)) and (scores is None or np.all(np.isfinite(scores)))
    ):
        raise InvalidInput("the boxes and scores of detections must be finite")
