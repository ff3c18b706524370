"""Curtains of rays at the most uncertain places, after Ancha et al., ECCV 2020."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells, Head
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy

PLACES = 25
"""Places along every column, to the range of the grid: 2 m apart on the paper's."""
BODY_M = (0.3, 1.8)
"""Heights above the road at which a ray would meet a body."""
FORGETS_S = 1.0
"""Time in which a seen place becomes uncertain again, to 1 - 1/e."""
STEP = 2
"""Places by which a curtain may change between neighbouring columns. It models the speed of the
device's mirror, which no LiDAR here has.
"""


class AfterAncha(Policy):
    """Place light curtains, each where it resolves the most uncertainty.

    A curtain has one distance in every column, and detects bodies there. The paper (arXiv
    2008.02191) chooses the curtain with the largest sum of the entropies of a detector's anchors.
    Limits of the mirror are edges of a graph, and dynamic programming finds the best path. Curtains
    follow one another.

    Differences here: a curtain costs the cells whose rays pass its places at the height of a body,
    and these rays also see nearer bodies. Entropies belong to places that become uncertain again,
    not to a trained detector. Places replace anchors, which lie evenly on the ground, so far places
    count for more. All curtains of a keyframe are placed before anything returns. If the budget
    cannot pay a curtain, its most useful part is fired. The camera plays no part, as in the paper.
    """

    name = "after-ancha"
    source = "after Ancha et al., Light Curtains, ECCV 2020, arXiv 2008.02191"
    is_pattern = True

    def __init__(self, rig: Rig):
        super().__init__(rig)
        self._places = (np.arange(PLACES) + 0.5).astype(np.float64) * (rig.grid.range_m / PLACES)
        self._passed = [self._passed_by(head) for head in rig.grid.heads]
        # No ray meets some places near the car, or between two rows.
        self._areas = [self._places * passed.any(axis=0) for passed in self._passed]
        self.reset()

    def reset(self) -> None:
        """Forget seen places."""
        self._uncertain = [np.ones(passed.shape[1:]) for passed in self._passed]

    def remember(self, belief: Belief) -> None:
        """Update the memory with the last scan, and age it."""
        kept = math.exp(-self.rig.keyframe_s / FORGETS_S)
        for n, head in enumerate(self.rig.grid.heads):
            ranges = belief.ranges.ravel()[head.cells].reshape(head.grid.shape)
            _see(self._uncertain[n], self._passed[n], ranges, self._places)
            self._uncertain[n] = 1 - kept * (1 - self._moved(self._uncertain[n], head, belief))

    def demand(self, belief: Belief) -> Demand:
        """Return curtains, one after the other, until the budget is spent. Several LiDARs take
        turns.
        """
        worth = [one * area for one, area in zip(self._uncertain, self._areas, strict=True)]
        fired = [np.zeros(head.grid.shape, np.bool_) for head in self.rig.grid.heads]
        curtains: list[Cells] = []
        left = belief.budget
        has_placed = True
        while left > 0 and has_placed:
            has_placed = False
            for n, head in enumerate(self.rig.grid.heads):
                rows, columns = _curtain(self._passed[n], worth[n], fired[n], left)
                curtains.append(head.first + rows * head.grid.columns + columns)
                left -= len(rows)
                has_placed |= len(rows) > 0
        return Demand(layers=[[curtain] for curtain in curtains])

    def _passed_by(self, head: Head) -> Mask:
        """Return (e, A, PLACES) the places that each cell's ray passes at the height of a body."""
        rises = np.tan(head.grid.elevations_everywhere)[..., None]
        heights = self.rig.sensor_height_m + head.place[2] + rises * self._places
        passed: Mask = (heights > BODY_M[0]) & (heights < BODY_M[1])
        return np.broadcast_to(passed, (*head.grid.shape, PLACES)).copy()

    def _moved(self, uncertain: Floats, head: Head, belief: Belief) -> Floats:
        """Return (A, PLACES) the memory moved by the car's way."""
        azimuths = head.grid.azimuths[:, None] + belief.ego.yaw_rate * self.rig.keyframe_s
        x = self._places * np.cos(azimuths) + belief.ego.speed * self.rig.keyframe_s
        y = self._places * np.sin(azimuths)
        spacing = head.grid.spacing
        column = np.floor((np.arctan2(y, x) - spacing.right) / spacing.column_width)
        column = column.astype(np.int64) % spacing.turn
        place = (np.hypot(x, y) / self.rig.grid.range_m * PLACES).astype(np.int64)
        inside = (column < len(uncertain)) & (place < PLACES)
        known = uncertain[np.where(inside, column, 0), np.where(inside, place, 0)]
        return np.where(inside, known, 1.0)


def _curtain(passed: Mask, worth: Floats, fired: Mask, budget: int) -> tuple[Integers, Integers]:
    """Return rows and columns (n,) of the next curtain's cells that are not `fired` (e, A) yet, and
    mark them as fired. Places lose their `worth` (A, PLACES) once all rays that could see them
    fire.
    """
    path = _best_path(worth, STEP)
    columns = np.arange(len(path))
    rays = passed[:, columns, path] & ~fired
    first, stop = _best_part(worth[columns, path], rays.sum(axis=0), budget)
    part = np.zeros_like(fired)
    part[:, first:stop] = rays[:, first:stop]
    fired |= part
    worth[~(passed & ~fired[..., None]).any(axis=0)] = 0.0
    rows, columns = np.nonzero(part)
    return rows, columns


@compiled()
def _see(uncertain: Floats, passed: Mask, ranges: np.ndarray, places: Floats) -> None:
    """Remove the uncertainty (A, PLACES) of the places before the `ranges` (e, A), metres, 0 for
    cells that were not fired.
    """
    for row in range(ranges.shape[0]):
        for column in range(ranges.shape[1]):
            for n in range(len(places)):
                if places[n] < ranges[row, column] and passed[row, column, n]:
                    uncertain[column, n] = 0.0


@compiled()
def _best_path(worth: Floats, step: int) -> Integers:
    """Return (A,) the place in every column of the path of most `worth` (A, PLACES). Dynamic
    programming over the constraint graph: places change by up to `step` between columns.
    """
    columns, places = worth.shape
    best = worth.copy()
    before = np.zeros((columns, places), np.int64)
    for column in range(1, columns):
        for place in range(places):
            lead = place
            for other in range(max(place - step, 0), min(place + step + 1, places)):
                if best[column - 1, other] > best[column - 1, lead]:
                    lead = other
            before[column, place] = lead
            best[column, place] += best[column - 1, lead]
    path = np.empty(columns, np.int64)
    path[-1] = best[-1].argmax()
    for column in range(columns - 1, 0, -1):
        path[column - 1] = before[column, path[column]]
    return path


@compiled()
def _best_part(worth: Floats, costs: Integers, budget: int) -> tuple[int, int]:
    """Return the begin and end of the most valuable adjacent columns within the budget, the first
    of equal ones.
    """
    most, part = 0.0, (0, 0)
    first, cost, gain = 0, 0, 0.0
    for stop in range(1, len(worth) + 1):
        cost += costs[stop - 1]
        gain += worth[stop - 1]
        while cost > budget:
            cost -= costs[first]
            gain -= worth[first]
            first += 1
        if gain > most:
            most, part = gain, (first, stop)
    return part
