"""A street while it is being drawn: what stands and moves where, and whether there is room for
more.
"""

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.streets.footprints import Footprint, meets_any, way_bounds
from care_sim.world.bodies import CATALOGUE

STEP_S = 0.1
"""Between two samples of a way. A car at 30 km/h moves 0.8 m meanwhile, so nobody can step through
one between two samples.
"""
STREET_KEYFRAME_S = 0.5
KEYFRAMES = 40
"""20 s at 2 Hz, as the scenes of nuScenes (paper, Sec. 5.1)."""
TIMES: Floats = STEP_S * np.arange(round(KEYFRAMES * STREET_KEYFRAME_S / STEP_S), dtype=np.float64)
"""(t,) seconds at which ways are sampled."""


class PlacedBodies:
    """Footprints with their ways, a row each in tables that grow. A way is (1, 3) for what stands,
    else (t, 3); all have one length.
    """

    def __init__(self) -> None:
        self._ways: Floats = np.empty((0, 1, 3))
        self._bounds: Floats = np.empty((0, 4))
        self._sizes: Floats = np.empty((0, 2))
        self._berths: Floats = np.empty(0)

    def add(self, way: Floats, size: Footprint, berth: float) -> None:
        """One more footprint, which others pass at `berth` metres or more."""
        ways = self._ways if len(self._ways) else np.empty((0, *way.shape))
        self._ways = np.concatenate([ways, way[None]])
        self._bounds = np.vstack([self._bounds, way_bounds(way)])
        self._sizes = np.vstack([self._sizes, size])
        self._berths = np.append(self._berths, berth)

    def meets(self, way: Floats, size: Footprint) -> bool:
        """Whether a footprint on `way` (1, 3) or (t, 3) ever comes closer to one of these than its
        berth, along every axis.
        """
        return bool(meets_any(way, size, self._ways, self._bounds, self._sizes, self._berths))


TOUCH_M = 0.01
"""Things that stand may come as close as this."""
SQUEEZE_M = 0.15
"""Least room of a walker on each side of a gap between things that stand: a hand's breadth."""


class Draft:
    """Bodies by kind with their ways, the ground that must stay free, and the generator that draws
    them. Ways are sampled at `times` (t,), seconds.
    """

    def __init__(self, rng: np.random.Generator, times: Floats = TIMES) -> None:
        self.rng = rng
        self.times = times
        self.kinds: list[str] = []
        self.ways: list[Floats] = []
        self._fixed = PlacedBodies()
        self._moving = PlacedBodies()
        self._reserved = PlacedBodies()

    def reserve(self, pose: Floats, size: Footprint) -> None:
        """Keep a rectangle free of everything that stands: a carriageway, a junction."""
        self._reserved.add(pose.reshape(1, 3), size, 0.0)

    def obstruct(self, way: Floats, size: Footprint, berth: float) -> None:
        """Let walkers keep clear of a way (t, 3) on which no body of the draft moves: the ego's."""
        self._moving.add(way, size, berth)

    def has_room(self, pose: Floats, size: Footprint) -> bool:
        """Whether a rectangle at a pose (3,) is free of all there is, now and later."""
        way = pose.reshape(1, 3)
        kept = self._reserved, self._fixed, self._moving
        return not any(bodies.meets(way, size) for bodies in kept)

    def stand(self, kind: str, pose: Floats) -> bool:
        """Put a body at a pose (3,) if there is room. Says whether there was."""
        way = pose.reshape(1, 3)
        size = _footprint(kind)
        if not self.has_room(pose, size):
            return False
        self._fixed.add(way, size, TOUCH_M)
        self._keep(kind, np.repeat(way, len(self.times), axis=0))
        return True

    def move(self, kind: str, way: Floats, berth: float) -> bool:
        """Let a body follow a way (t, 3) if nothing ever stands or passes there. Says whether it
        could.
        """
        size = _footprint(kind)
        # What stands must leave room on both sides. What moves has a berth of its own.
        if self._fixed.meets(
            way, (size[0] + 2 * SQUEEZE_M, size[1] + 2 * SQUEEZE_M)
        ) or self._moving.meets(way, size):
            return False
        self.drive(kind, way, berth)
        return True

    def drive(self, kind: str, way: Floats, berth: float) -> None:
        """Let a body follow a way (t, 3) that is known to be free: traffic that minds itself."""
        self._moving.add(way, _footprint(kind), berth)
        self._keep(kind, way)

    def _keep(self, kind: str, way: Floats) -> None:
        self.kinds.append(kind)
        self.ways.append(way)


def _footprint(kind: str) -> Footprint:
    length, width, _ = CATALOGUE[kind].size
    return length, width
