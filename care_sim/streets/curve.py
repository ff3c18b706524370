"""The reference line of a road, and the way from road coordinates to the world and along it."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.frames import Pose, turned


@dataclass(frozen=True)
class Curve:
    """A straight, one bend, and a straight again. Metres and radians.

    Road coordinates: `s` along the line, `d` to its left, headings relative to its own. The line
    begins at the world pose `start` with s = 0; it bends from `bend_at` on for `bend_length` with
    `curvature` (1/m, positive to the left). Before 0 and after the bend it goes on straight.
    """

    start: Pose = (0.0, 0.0, 0.0)
    bend_at: float = 0.0
    bend_length: float = 0.0
    curvature: float = 0.0

    def heading(self, s: Floats | float) -> Floats:
        """World heading of the line at `s`."""
        along = np.clip(np.asarray(s) - self.bend_at, 0.0, self.bend_length)
        return np.asarray(self.start[2] + self.curvature * along)

    def curvature_at(self, s: float) -> float:
        """Curvature of the line at `s`, 1/m."""
        return self.curvature if self.bend_at <= s < self.bend_at + self.bend_length else 0.0

    def to_world(self, places: Floats) -> Floats:
        """World poses (..., 3: x, y, heading) of places (..., 3: s, d, heading) on the road."""
        places = np.asarray(places, dtype=float)
        s, d, heading = places[..., 0], places[..., 1], places[..., 2]
        along = np.minimum(np.maximum(s - self.bend_at, 0.0), self.bend_length)
        turn = self.curvature * along
        # The chord of a circle's arc, 2 R sin(turn / 2) with the radius R = along / turn. NumPy's
        # sinc(x) is sin(pi x) / (pi x) and 1 at 0, where the road is straight and R infinite.
        chord = along * np.sinc(turn / (2 * np.pi)) if self.curvature else along
        before = np.minimum(s, self.bend_at)
        after = np.maximum(s - self.bend_at - self.bend_length, 0.0)
        # Three parts, one after the other: the straight before lies along x, the chord at half the
        # turn, the straight after at the whole turn. d goes to the left of where the line points.
        cos, sin = np.cos(turn), np.sin(turn)
        world = np.empty(places.shape)
        world[..., 0] = before + chord * np.cos(turn / 2) + after * cos - d * sin
        world[..., 1] = chord * np.sin(turn / 2) + after * sin + d * cos
        world[..., 2] = self.start[2] + turn + heading
        world[..., :2] = turned(world[..., :2], self.start[2]) + self.start[:2]
        return world


@dataclass(frozen=True)
class Walked:
    """A way covered at constant `speed` (m/s): a person's or a cyclist's.

    `corners` (k, 2) are s and d of the way's corners on `curve`. The walker is at the beginning at
    `starts_s`, and stands at either end before and after. Distances are measured in the world, so
    that the speed holds in a bend.
    """

    curve: Curve
    corners: tuple[tuple[float, float], ...]
    speed: float
    starts_s: float = 0.0

    STRIDE_M = 1.0

    def poses(self, times: Floats) -> Floats:
        """World poses (t, 3) at `times` (t,)."""
        points = self._points()
        legs = np.diff(points, axis=0)
        # Metres done at every point of the way, and by the walker at every time.
        covered = np.concatenate([[0.0], np.cumsum(np.hypot(*legs.T))])
        way = np.clip(self.speed * (times - self.starts_s), 0.0, covered[-1])
        # Who stands at the end still faces along the last leg.
        leg = np.clip(np.searchsorted(covered, way, side="right") - 1, 0, len(legs) - 1)
        x, y = (np.interp(way, covered, points[:, axis]) for axis in (0, 1))
        return np.column_stack([x, y, np.arctan2(legs[leg, 1], legs[leg, 0])])

    def _points(self) -> Floats:
        """(n, 2) world points of the way, about a stride apart at most, to follow bends."""
        places = [np.array([self.corners[0]])]
        for start, end in zip(self.corners, self.corners[1:], strict=False):
            pieces = max(
                int(np.ceil(np.hypot(end[0] - start[0], end[1] - start[1]) / self.STRIDE_M)), 1
            )
            shares = np.arange(1, pieces + 1) / pieces
            places.append(np.array(start) + shares[:, None] * (np.array(end) - start))
        road = np.concatenate(places)
        return self.curve.to_world(np.column_stack([road, np.zeros(len(road))]))[:, :2]
