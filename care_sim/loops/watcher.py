"""The closed loop with all that is true about it, for people who watch an episode.

It is gathered only while somebody watches.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from care_sim.core.actions import shares_of
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.frames import Frame, Pose
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid
from care_sim.core.residual import explained
from care_sim.core.types import Action, Demand, ImageDetections
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.world.world import Actor, World

WAY_M = 40.0
"""How far ahead of the sensor the car's way is told."""
_PIECES = 40
"""Of a way that may bend."""


def sought(world: World) -> list[Actor]:
    """Whom the episode is about: everybody whom a drive lets the ego meet, in the order of the way,
    else the first-sighting actor; empty without either.
    """
    if world.meetings:
        actors = {actor.body: actor for actor in world.actors}
        return [actors[one.body] for one in world.meetings]
    return [world.first_sighting] if world.first_sighting else []


def way_ahead(world: World, sensor_x: float, ahead: float) -> Pose:
    """World pose of the middle of the way `ahead` metres before the LiDAR, which is `sensor_x`
    ahead of the car's centre.
    """
    if world.route is not None:
        return world.route.pose(world.along_m + sensor_x + ahead)
    x, y, yaw = world.ego.pose
    reach = sensor_x + ahead
    return x + reach * float(np.cos(yaw)), y + reach * float(np.sin(yaw)), yaw


@dataclass(frozen=True)
class TrueSituation:
    """What is there when the cells of a keyframe are chosen.

    Truth: for people and scoring, never for a policy.

    Boxes are in the world frame.
    """

    time_s: float
    """Seconds from the start."""
    sensor: Frame
    """The LiDAR in the world."""
    ego: Floats
    """(7,) the box of the car."""
    way: Floats
    """(n, 3) world poses on the car's way, the middles of n equal pieces of `WAY_M` metres from the
    sensor on; one piece where no route bends it, none in the open loop.
    """
    names: tuple[str, ...]
    """(n,) of all actors."""
    labels: tuple[int | None, ...]
    """(n,) places in `CLASSES`; None where perception does not report the actor."""
    bodies: Floats
    """(n, 7) the boxes of all actors."""
    target: int | None
    """The row of the first-sighting actor, None without one."""
    belief: Belief
    """All that the policy was shown."""
    known: Mask
    """(k,) which detections of the belief a forecast explains."""
    false: Mask
    """(k,) which of them show nothing."""
    missed: ImageDetections
    """Those that the camera without its faults would have given besides."""


@dataclass(frozen=True)
class Watched:
    """A keyframe of either loop with all that is true about it."""

    situation: TrueSituation
    """How things stood before it."""
    shares: NDArray[np.uint8]
    """(E, A) the share of the budget of each cell, a place in `care_sim.core.actions.SHARES`."""
    ranges: NDArray[np.float32]
    """(E, A) the scan in metres: 0 not fired, maximum range without a return."""

    def returned(self, grid: Grid) -> tuple[Cells, Floats]:
        """The cells (n,) that returned, ascending, and the points (n, 3), sensor frame."""
        ranges = self.ranges.ravel()
        # Neither not fired (0) nor without return (the reach).
        cells = np.flatnonzero((ranges > 0) & (ranges < grid.range_m))
        return cells, grid.points(cells, ranges[cells].astype(np.float64))


@dataclass(frozen=True)
class WatchedKeyframe(Watched):
    """One of the closed loop."""

    record: Keyframe
    """For the scoring."""


def _way(world: World, sensor_x: float) -> Floats:
    pieces = 1 if world.route is None else _PIECES
    middles = (np.arange(pieces) + 0.5) * WAY_M / pieces
    return np.array([way_ahead(world, sensor_x, ahead) for ahead in middles.tolist()])


class EpisodeWatcher:
    """Follows the running episode of a loop: `situation` is asked before every keyframe, `watched`
    after it.

    `confidence` is the threshold of the camera's detector.
    """

    def __init__(self, loop: ClosedLoop, confidence: float):
        self._loop = loop
        self._confidence = confidence

    def situation(self) -> TrueSituation:
        """How things stand before the next keyframe."""
        loop = self._loop
        world = loop.world
        shown = loop.belief.detections
        return TrueSituation(
            time_s=world.time,
            sensor=loop.sensor,
            ego=world.boxes_of(np.array([world.ego_body]))[0],
            way=_way(world, loop.rig.sensor_x_m),
            names=tuple(actor.name for actor in world.actors),
            labels=tuple(actor.label for actor in world.actors),
            bodies=world.boxes(world.actors).copy(),
            target=world.actors.index(world.first_sighting) if world.first_sighting else None,
            belief=loop.belief,
            known=explained(shown, loop.belief.tracks, loop.rig),
            false=loop.detected_bodies == NO_OBJECT,
            missed=self._missed(loop.detected_bodies),
        )

    def watched(
        self, situation: TrueSituation, action: Action, demand: Demand | None, record: Keyframe
    ) -> WatchedKeyframe:
        """The keyframe that the loop has played since the situation."""
        loop = self._loop
        return WatchedKeyframe(
            situation, shares_of(record.fired, action, demand, loop.rig), loop.belief.ranges, record
        )

    def _missed(self, given: Integers) -> ImageDetections:
        """What a camera without faults would report now, less the bodies that were `given`."""
        # Through the camera as designed: what an error of its mount hides is missed, too.
        clear = self._loop.cameras.faultless()
        rows = clear.detections.rows()
        sure = clear.detections.confidences >= self._confidence
        return ImageDetections.from_rows(rows[sure & ~np.isin(clear.objects, given)])
