"""The steps of the detector `cluster`, put together."""

from dataclasses import dataclass

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.frames import turned
from care_sim.core.grid import AngularGrid
from care_sim.core.types import Detections
from care_sim.perception.cluster.boxes import DECIMALS, MOST_MISFIT, Guess, best_guess, fit_sides
from care_sim.perception.cluster.points import (
    KERB_CLEARANCE_M,
    clusters_of,
    heights_above,
    road_plane,
)

OWN_ROOF_M = 2.0
"""Range within which returns are the car's own roof: a quarter of a recorded nuScenes sweep."""

_GRID = AngularGrid()


@dataclass(frozen=True)
class _Candidate:
    """A cluster: its number of `points`, the `place` (2,) amid them, and its best guess."""

    points: int
    place: Floats
    guess: Guess


class ClusterDetector:
    """A detector that reads only points: remove the road, DBSCAN, boxes on the shown sides, classes
    by size.

    These four steps are classical, with nothing learned (`points`, `boxes`).

    `grid` gives the distance of neighbouring points. A cluster needs three points, as for the
    proxy. The confidence of n points is 1 - 1 / sqrt(n), since the error of an average falls as 1 /
    sqrt(n). The order of the points does not matter.

    Recall with every cell fired on a single body of the catalogue, 12 headings per range, within 2
    m and in its class. Cars, trucks and buses: 99% to 25 m and 97% from 30 to 45 m. Pedestrians:
    98% to 20 m, 58% at 25 and 30 m (3 returns), none beyond. Bicycles: 93% to 20 m, 25% at 25 and
    30 m (most are taken for pedestrians), none beyond.

    Recall on six generated streets, of objects with three returns or more: 93% to 15 m, 59% from
    there to 30 m, 44% from there to 50 m. Parts of cars in a parked row are taken for pedestrians
    or bicycles. The detector reports 29 boxes per keyframe, of which 16 match no such object.
    """

    far = False
    stateless = True

    def __init__(self, grid: AngularGrid = _GRID):
        self._grid = grid

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`; surest first, then nearest first.

        Raises InvalidInput for points that are not (P, 3) finite numbers.
        """
        points = _in_order(points)
        points = points[np.hypot(points[:, 0], points[:, 1]) > OWN_ROOF_M]
        plane = road_plane(points, sensor_height_m)
        heights = heights_above(points, plane)
        above = heights > KERB_CLEARANCE_M
        standing = points[above]
        heights = heights[above]

        # Clusters with fewer points than the proxy needs, or that fit no class, are dropped. The
        # candidate with more points stays if two are at one place.
        clusters = [
            rows for rows in clusters_of(standing[:, :2], self._grid) if len(rows) >= MIN_RETURNS
        ]
        found = [
            self._candidate(standing[rows], heights[rows].max(), plane, sensor_height_m)
            for rows in clusters
        ]
        return _detections(
            _drop_overlaps([one for one in found if one.guess.misfit <= MOST_MISFIT])
        )

    def _candidate(
        self, points: Floats, top_m: float, plane: Floats, sensor_height_m: float
    ) -> _Candidate:
        sides = fit_sides(points[:, :2])
        place = sides.middle @ sides.axes
        guess = best_guess(sides, top_m, plane @ [*place, 1.0], sensor_height_m, self._grid)
        return _Candidate(len(points), place, guess)


def _in_order(points: Floats) -> Floats:
    """Return points (P, 3) sorted, so that sums over them are bit-identical."""
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise InvalidInput(f"points must be (P, 3) finite numbers, got the shape {array.shape}")
    return array[np.lexsort(array.T)]


def _drop_overlaps(found: list[_Candidate]) -> list[_Candidate]:
    """Drop candidates inside the box of a candidate with more points, since two bodies do not share
    a place.

    Examples are a windscreen behind a bonnet, and a side seen too obliquely to be connected.
    """
    # Candidates with the most points come first, then the nearest. The distance is rounded, so that
    # the order of equal ones is not that of their last bits.
    kept: list[_Candidate] = []
    for candidate in sorted(
        found, key=lambda one: (-one.points, np.round(np.hypot(*one.place), DECIMALS))
    ):
        if not any(_holds(other.guess.box, candidate.place) for other in kept):
            kept.append(candidate)
    return kept


def _holds(box: Floats, place: Floats) -> bool:
    return bool(np.all(np.abs(turned(place - box[:2], -box[6])) <= box[3:5] / 2))


def _detections(found: list[_Candidate]) -> Detections:
    returns = np.array([one.points for one in found], np.int64)
    return Detections(
        np.array([one.guess.label for one in found], np.int64),
        np.array([one.guess.box for one in found], np.float64).reshape(-1, 7),
        returns,
        1 - 1 / np.sqrt(returns),
    )
