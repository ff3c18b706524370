"""The paper's policies that follow tracks: history, history with an undirected reserve or one for
unexplained returns, and the oracle of the true next poses.
"""

from functools import lru_cache

import numpy as np

from care_sim.core.allocation import half_up
from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.cells.sets import WorldSets
from care_sim.core.cells.stack import Grid
from care_sim.core.frames import Frame, turned
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Demand, Ego
from care_sim.policies.base import Policy, PrivilegedPolicy, RowPolicy


class History(RowPolicy):
    """The base policy of the paper (Sec. 4.1), its re-implementation of history-driven scanning.

    The exploitation sets are the dilated hulls of the forecasts, nearest first. The reserve is
    empty, so the random floor takes the rest.
    """

    name = "history"
    source = "CARE paper, Sec. 4.1, after adaptive LiDAR scanning (2026)"

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the hulls of all forecasts."""
        return [beliefs.hulls]


GOLDEN = (np.sqrt(5) - 1) / 2
"""Golden ratio: its multiples spread most evenly round a circle (Kronecker sequence)."""


class HistoryUniform(Policy):
    """The control history+uniform of the paper (Sec. 5.1).

    The whole reserve, rho B cells, goes to one undirected pattern that stays the same over the
    episode.
    """

    name = "history-uniform"
    source = "CARE paper, Sec. 5.1 (history+uniform)"

    def __init__(self, rig: Rig):
        super().__init__(rig)
        # The reserve is the rest after exploitation, as Algorithm 1 rounds it.
        reserve = rig.budget - half_up((1 - rig.reserve_fraction) * rig.budget)
        self._pattern = uniform_pattern(rig.grid, reserve)

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls, then the pattern."""
        return Demand(self.rig.hulls(belief.tracks.boxes), [[self._pattern]])


@lru_cache(maxsize=8)
def uniform_pattern(grid: Grid, count: int) -> Cells:
    """Return `count` different cells, ascending: equally many per row, evenly spaced. Read-only,
    since the pattern is kept for the next keyframe.

    Each row is shifted against the one above by the golden ratio of its spacing.
    """
    # Divide the cells among rows as evenly as possible, then place them in each row.
    numbers = np.arange(count)
    row = numbers * grid.rows // max(count, 1)
    in_row = np.bincount(row, minlength=grid.rows)
    place = numbers - (np.cumsum(in_row) - in_row)[row]
    # Unshifted, the pattern would be a lattice with empty columns. The spacing in a row is at least
    # one column, so no cell comes twice.
    column = np.floor((place + row * GOLDEN % 1) * grid.columns / in_row[row]).astype(np.int64)
    cells: Cells = row * grid.columns + column
    cells.flags.writeable = False
    return cells


GROUND_CLEARANCE_M = 0.3
"""Returns lower than this above a level road are ground (the threshold of the Argoverse 2 map API).
A detector that fits the road's plane is more exact: see
`care_sim.perception.cluster.points.KERB_CLEARANCE_M`.
"""
BOX_MARGIN_M = 0.2
"""Margin of boxes. An error of 1 m/s in the car's own speed moves a box by 0.1 m in a keyframe of
0.1 s. Three deviations of a ranging noise of 2 to 3 cm add another 0.1 m.
"""
SHELL_M = 1.0
"""Depth of a layer. Within it cells come in ascending order; finer would only cost time."""


class Uncertainty(Policy):
    """The uncertainty reserve of the paper (Sec. 5.1), in the style of light curtains.

    Cells that were occupied but undetected at the previous scan are fired again, the closest
    obstacle first (Ancha et al., ECCV 2020; safety envelopes, RSS 2021).
    """

    name = "uncertainty"
    source = "CARE paper, Sec. 5.1, after Ancha et al., Light Curtains, ECCV 2020 and RSS 2021"

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls, then unexplained returns in shells of distance, nearest first."""
        cells, ranges = self._unexplained(belief)
        # A layer per shell; a layer's one set is taken in ascending order of its cells.
        shell = np.floor(ranges / SHELL_M)
        layers = [[cells[shell == number]] for number in np.unique(shell)]
        return Demand(self.rig.hulls(belief.tracks.boxes), layers)

    def _unexplained(self, belief: Belief) -> tuple[Cells, Floats]:
        """Return cells (n,) and ranges (n,) of the last scan's returns above the ground and outside
        detected boxes.
        """
        # A range of 0 was not fired; the reach of the grid means no return.
        cells = np.flatnonzero((belief.ranges > 0) & (belief.ranges < self.rig.grid.range_m))
        ranges = belief.ranges.ravel()[cells].astype(np.float64)
        points = self.rig.grid.points(cells, ranges)
        unexplained = points[:, 2] + self.rig.sensor_height_m >= GROUND_CLEARANCE_M
        for box in self._detected_boxes(belief):
            unexplained &= ~_inside(points, box)
        return cells[unexplained], ranges[unexplained]

    def _detected_boxes(self, belief: Belief) -> Floats:
        """Return (n, 7) the boxes detected at the last scan, moved back to that time, in the sensor
        frame of then.
        """
        # Tracks are forecasts for the next keyframe: move them back by their own way, then by the
        # car's.
        seen = belief.tracks.take(belief.tracks.misses == 0)
        boxes = seen.boxes.copy()
        boxes[:, :2] -= seen.velocities * self.rig.keyframe_s
        return _travelled(belief.ego, self.rig.keyframe_s).boxes_to_world(boxes)


def _travelled(ego: Ego, duration: float) -> Frame:
    """Return the current sensor frame in the frame of `duration` seconds ago."""
    # The speed half way back. A car that has just set off stood before; it did not reverse.
    mean = ego.speed - ego.acceleration * duration / 2
    way = (max(mean, 0.0) if ego.speed >= 0 else min(mean, 0.0)) * duration
    # An arc of constant yaw rate has a chord in the direction of half the turn. Its length is taken
    # for the arc's: at 1 rad/s and 0.1 s they differ by 4 parts in 10,000.
    yaw = ego.yaw_rate * duration
    return Frame(way * np.cos(yaw / 2), way * np.sin(yaw / 2), 0.0, yaw)


def _inside(points: Floats, box: Floats) -> Mask:
    """Return (n,) which points (n, 3) lie in the widened box (7,)."""
    local = np.abs(turned(points - box[:3], -box[6]))
    inside: Mask = np.all(local <= box[3:6] / 2 + BOX_MARGIN_M, axis=1)
    return inside


class HistoryOracle(PrivilegedPolicy):
    """The oracle of the paper (Sec. 5.2): history with the true next positions of tracked objects.

    The true positions replace the forecasts. The policy is an upper bound of learned region
    predictors. New objects stay unknown to it.
    """

    name = "history-oracle"
    source = "CARE paper, Sec. 5.2 (oracle variant)"

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls of the true boxes, nearest first."""
        boxes = self.truth.boxes(belief.tracks)
        # True places may be in another order than the forecasts; equal ones keep theirs.
        nearest_first = np.argsort(planar_ranges(boxes), kind="stable")
        return Demand(self.rig.hulls(boxes[nearest_first]))
