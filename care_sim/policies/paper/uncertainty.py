"""History with a reserve on returns that no detection explains."""

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import Belief
from care_sim.core.frames import Frame, turned
from care_sim.core.grid import Cells
from care_sim.core.types import Demand, Ego
from care_sim.policies.base import Policy

GROUND_CLEARANCE_M = 0.3
"""Returns lower than this above a level road are ground (the threshold of the Argoverse 2 map API).
A detector that fits the road's plane knows it better: see
`care_sim.perception.cluster.road.KERB_CLEARANCE_M`.
"""
BOX_MARGIN_M = 0.2
"""Boxes reach this much further: an error of 1 m/s in the car's own speed moves a box by 0.1 m in a
keyframe of 0.1 s, and three deviations of a ranging noise of 2 to 3 cm another 0.1 m."""
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
        """Hulls, then unexplained returns in shells of distance, nearest first."""
        cells, ranges = self._unexplained(belief)
        # A layer per shell; a layer's one set is taken in ascending order of its cells.
        shell = np.floor(ranges / SHELL_M)
        layers = [[cells[shell == number]] for number in np.unique(shell)]
        return Demand(self.rig.hulls(belief.tracks.boxes), layers)

    def _unexplained(self, belief: Belief) -> tuple[Cells, Floats]:
        """Cells (n,) and ranges (n,) of the last scan's returns above the ground and outside
        detected boxes.
        """
        # 0 was not fired, and the range of the grid returned nothing.
        cells = np.flatnonzero((belief.ranges > 0) & (belief.ranges < self.rig.grid.range_m))
        ranges = belief.ranges.ravel()[cells].astype(np.float64)
        points = self.rig.grid.points(cells, ranges)
        unexplained = points[:, 2] + self.rig.sensor_height_m >= GROUND_CLEARANCE_M
        for box in self._detected_boxes(belief):
            unexplained &= ~_inside(points, box)
        return cells[unexplained], ranges[unexplained]

    def _detected_boxes(self, belief: Belief) -> Floats:
        """(n, 7) boxes detected at the last scan, moved back to it, in the sensor frame of then."""
        # Tracks are forecasts for the coming keyframe: back by their own way, then by the car's.
        seen = belief.tracks.take(belief.tracks.misses == 0)
        boxes = seen.boxes.copy()
        boxes[:, :2] -= seen.velocities * self.rig.keyframe_s
        return _travelled(belief.ego, self.rig.keyframe_s).boxes_to_world(boxes)


def _travelled(ego: Ego, duration: float) -> Frame:
    """The sensor frame of now in that of `duration` seconds ago."""
    # The speed half way back. A car that has just set off stood before; it did not drive the other
    # way.
    mean = ego.speed - ego.acceleration * duration / 2
    way = (max(mean, 0.0) if ego.speed >= 0 else min(mean, 0.0)) * duration
    # An arc of constant yaw rate has a chord in the direction of half the turn. Its length is taken
    # for the arc's: at 1 rad/s and 0.1 s they differ by 4 parts in 10,000.
    yaw = ego.yaw_rate * duration
    return Frame(way * np.cos(yaw / 2), way * np.sin(yaw / 2), 0.0, yaw)


def _inside(points: Floats, box: Floats) -> Mask:
    """(n,) which points (n, 3) lie in the widened box (7,)."""
    local = np.abs(turned(points - box[:3], -box[6]))
    inside: Mask = np.all(local <= box[3:6] / 2 + BOX_MARGIN_M, axis=1)
    return inside
