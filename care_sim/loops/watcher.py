"""Either loop with all that is true about it, for people who watch an episode or a play.

It is gathered only while somebody watches.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.stack import Grid
from care_sim.core.firing.actions import shares_of
from care_sim.core.frames import Frame, Pose
from care_sim.core.grid import Cells
from care_sim.core.residual import explained
from care_sim.core.types import CLASSES, Action, Demand, ImageDetections
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop, SceneKeyframe
from care_sim.loops.records import Keyframe
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.world.bodies import CATALOGUE
from care_sim.world.world import Actor, World

WAY_M = 40.0
"""Length of the shown way ahead of the sensor."""
_PIECES = 40
"""Pieces of a way that may bend."""


def sought(world: World) -> list[Actor]:
    """Return the subjects of an episode: the actors that a drive lets the ego meet, in the order of
    the way, else the first-sighting actor; empty without either.
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


def returned(ranges: NDArray[np.floating], grid: Grid) -> tuple[Cells, Floats]:
    """The cells (n,) of a scan `ranges` (E, A) that returned, ascending, and the points (n, 3),
    sensor frame.
    """
    flat = ranges.ravel()
    # Neither not fired (0) nor without return (the reach).
    cells = np.flatnonzero((flat > 0) & (flat < grid.range_m))
    return cells, grid.points(cells, flat[cells].astype(np.float64))


@dataclass(frozen=True)
class TrueSituation:
    """The scene when the cells of a keyframe are chosen, and the part that the policy was shown.
    Boxes are in the world frame. Truth: for people and scoring, never for a policy.
    """

    time_s: float
    """Seconds from the start."""
    sensor: Frame
    """The LiDAR in the world."""
    ego: Floats
    """(7,) the box of the car."""
    way: Floats
    """(n, 3) world poses on the car's way: the middles of n equal pieces of `WAY_M` metres from the
    sensor on. It has one piece where no route bends the way, and none in the open loop.
    """
    names: tuple[str, ...]
    """(n,) of all actors, or of the annotated objects."""
    labels: tuple[int | None, ...]
    """(n,) places in `CLASSES`; None where perception does not report the actor."""
    bodies: Floats
    """(n, 7) their boxes."""
    target: int | None
    """The row of the first-sighting actor, None without one."""
    belief: Belief
    """All that the policy was shown."""
    known: Mask
    """(k,) which detections of the belief a forecast explains."""
    false: Mask
    """(k,) which of them show nothing."""
    missed: ImageDetections
    """Detections that a faultless camera would have added."""


@dataclass(frozen=True)
class Watched:
    """A keyframe of either loop with all that is true about it."""

    situation: TrueSituation
    """How things stood before it."""
    shares: NDArray[np.uint8]
    """(E, A) each cell's share of the budget, a place in `care_sim.core.firing.actions.SHARES`."""
    ranges: NDArray[np.float32]
    """(E, A) the scan in metres: 0 not fired, maximum range without a return."""
    record: Keyframe | SceneKeyframe
    """For the scoring: of the closed loop, or what a keyframe of a film found."""
    fired: Cells
    """(n,) the cells that fired, each as often as it was fired."""

    def returned(self, grid: Grid) -> tuple[Cells, Floats]:
        """The cells (n,) that returned, ascending, and the points (n, 3), sensor frame."""
        return returned(self.ranges, grid)


class Watcher:
    """Follows the running episode of a loop: call `situation` before every keyframe, `watched`
    after it.

    `confidence` is the threshold of the camera's detector.
    """

    def __init__(self, loop: OneWorld | OpenLoop, confidence: float):
        self._loop = loop
        self._confidence = confidence

    def situation(self) -> TrueSituation:
        """How things stand before the next keyframe."""
        loop = self._loop
        if isinstance(loop, OneWorld):
            # Through the camera as designed: what an error of its mount hides is missed, too.
            there, given, clear = _of_world(loop), loop.detected_bodies, loop.faultless()
        else:
            there, given, clear = _of_film(loop), loop.true_detected_objects(), loop.shot.seen
        sure = clear.detections.confidences >= self._confidence
        missed = clear.detections.rows()[sure & ~np.isin(clear.objects, given)]
        return TrueSituation(
            **there,
            belief=loop.belief,
            known=explained(loop.belief.detections, loop.belief.tracks, loop.rig),
            false=given == NO_OBJECT,
            missed=ImageDetections.from_rows(missed),
        )

    def watched(
        self,
        situation: TrueSituation,
        action: Action,
        demand: Demand | None,
        record: Keyframe | SceneKeyframe,
    ) -> Watched:
        """The keyframe that the loop has played since the situation."""
        loop, fired = self._loop, record.fired
        assert fired is not None
        shares = shares_of(fired, action, demand, loop.rig)
        ranges = loop.belief.ranges if isinstance(loop, OneWorld) else loop.last_ranges
        return Watched(situation, shares, ranges, record, fired)


def _of_world(loop: OneWorld) -> dict[str, Any]:
    """The surroundings of a world's ego."""
    world = loop.world
    pieces = 1 if world.route is None else _PIECES
    middles = (np.arange(pieces) + 0.5) * WAY_M / pieces
    return {
        "time_s": world.time,
        "sensor": loop.sensor,
        "ego": world.boxes_of(np.array([world.ego_body]))[0],
        "way": np.array([way_ahead(world, loop.rig.sensor_x_m, m) for m in middles.tolist()]),
        "names": tuple(actor.name for actor in world.actors),
        "labels": tuple(actor.label for actor in world.actors),
        "bodies": world.boxes(world.actors).copy(),
        "target": world.actors.index(world.first_sighting) if world.first_sighting else None,
    }


def _of_film(loop: OpenLoop) -> dict[str, Any]:
    """The surroundings in a film's keyframe."""
    shot, (x, y, height), size = loop.shot, loop.film.position, CATALOGUE["ego"].size
    car = np.array([[-x, -y, size[2] / 2 - height, *size, 0.0]])
    annotations = shot.annotations
    named = zip(annotations.classes.tolist(), annotations.objects.tolist(), strict=True)
    return {
        "time_s": shot.time_s,
        "sensor": shot.sensor,
        "ego": shot.sensor.boxes_to_world(car)[0],
        "way": np.empty((0, 3)),
        "names": tuple(f"{CLASSES[label]} {number}" for label, number in named),
        "labels": tuple(annotations.classes.tolist()),
        "bodies": shot.sensor.boxes_to_world(annotations.boxes),
        "target": None,
    }
