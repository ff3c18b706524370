"""Which annotated objects a detector found: the class-consistent 2 m centre match (paper, Remark
1).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Mask
from care_sim.core.types import Detections
from care_sim.sensors.annotated import Annotations

MATCH_M = 2.0
"""Greatest planar distance between the centres of an object and of its detection, this value
included.
"""


def found_objects(annotations: Annotations, detections: Detections) -> Mask:
    """(n,) whether each annotated object has a detection of its class within 2 m, in the plane.

    A detection serves one object. Detections without scores are assigned so that they serve the
    most objects and, among such assignments, with the least sum of distances. Detections with
    scores choose in descending order of score, each the nearest object still free, which is the
    rule of the official nuScenes evaluation. Objects of all ranges take part, so that a detection
    of one beyond the scored range is not counted for a neighbour within it. Raises InvalidInput for
    detections whose columns do not fit together or are not finite.
    """
    _check(detections)
    scores = detections.scores
    distances = _distances(annotations, detections)
    rows = _optimal(distances) if scores is None else _by_score(distances, scores)
    result = np.zeros(len(annotations), bool)
    result[rows] = True
    return result


def _distances(annotations: Annotations, detections: Detections) -> Floats:
    """(n, m) planar metres between the centres, inf where the pair is no match."""
    distances = cdist(annotations.boxes[:, :2], detections.boxes[:, :2])
    matching = (distances <= MATCH_M) & (annotations.classes[:, None] == detections.classes)
    return np.where(matching, distances, np.inf)


def _optimal(distances: Floats) -> NDArray[np.intp]:
    near = np.isfinite(distances)
    # Objects and detections without any match are left out first: the assignment grows with the
    # third power of their number.
    rows = np.flatnonzero(near.any(axis=1))
    distances = distances[rows][:, near.any(axis=0)]

    # A pair that is no match costs more than all matches together. So an assignment of the least
    # cost serves as many objects as possible, and among such it has the least sum of distances.
    worse_than_all = MATCH_M * (min(distances.shape) + 1)
    served, by = linear_sum_assignment(np.minimum(distances, worse_than_all))
    return rows[served[np.isfinite(distances[served, by])]]


def _by_score(distances: Floats, scores: Floats) -> list[int]:
    # Stable, so that of equally sure detections the first reported chooses first.
    free = distances.copy()
    served: list[int] = []
    for detection in np.argsort(-scores, kind="stable") if len(distances) else ():
        nearest = int(free[:, detection].argmin())
        if np.isfinite(free[nearest, detection]):
            # An object that is served is as far as can be from every later detection.
            served.append(nearest)
            free[nearest] = np.inf
    return served


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
