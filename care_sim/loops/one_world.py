"""One world of the closed loop, with all that is true about it."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from care_sim.core.arrays import ONE_WORLD, Floats, Integers
from care_sim.core.belief import Belief
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.core.types import Scan
from care_sim.loops.episode import Episode, SensorSeeds
from care_sim.loops.loop import Loop
from care_sim.loops.records import Keyframe, Records
from care_sim.loops.stages.scanning import lidar_of
from care_sim.loops.stages.sight import photographed
from care_sim.loops.stages.state import Fired
from care_sim.loops.truth import TrueLoop
from care_sim.perception.points_only import Detector
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.engines import make_engine
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.pictures import faultless_detections
from care_sim.world.world import World

_NO_FAULT = np.random.SeedSequence(0)


class OneWorld(TrueLoop):
    """The episode that runs in a loop of one world. Its attributes are of the coming keyframe: they
    change with every call of `keyframe`. Use the one of the current episode: `reset` makes another.
    """

    def __init__(self, loop: Loop):
        super().__init__()
        self._loop = loop
        self._kept: tuple[int, Belief] | None = None
        self.rig = loop.rig

    @classmethod
    def begun(
        cls,
        world: World,
        rig: Rig,
        conditions: ClosedLoopConditions,
        seeds: SensorSeeds,
        duration_s: float,
        detector: Detector | None = None,
    ) -> "OneWorld":
        """An episode of up to `duration_s` seconds in a loop of its own. Without a `detector` the
        paper's proxy detects what enough fired rays hit.
        """
        loop = Loop([rig], [conditions], duration_s, [detector])
        # The caller chooses the cells, so no floor is needed.
        loop.begin({0: Episode(world, seeds, _NO_FAULT)})
        return cls(loop)

    def keyframe(self, fired: Cells) -> Keyframe:
        """Fire `fired`, act on what came back, and move on to the next keyframe."""
        return self.record(self._loop.keyframe(Fired.of([fired]), ONE_WORLD))

    def record(self, records: Records) -> Keyframe:
        """The record of the keyframe that the loop has played since."""
        loop, found, impact = self._loop, self._loop.found, self._loop.impacts.get(0)
        counts, cells = loop.fired
        self._note(found.tracks[0, : found.counts[0]], found.behind(0))
        columns: Iterable[np.ndarray] = records
        told: dict[str, Any] = {
            name: column.item() for name, column in zip(Records._fields, columns, strict=True)
        }
        told |= {
            "index": self.index,
            "fired": cells[0, : counts[0]].copy(),
            "impact_speed_mps": impact.speed_mps if impact else None,
            "impact": impact,
            "sights": loop.sights.get(0, ()),
        }
        self.index += 1
        return Keyframe(**told)

    @property
    def world(self) -> World:
        """The world at the coming keyframe. Reading it moves its bodies there."""
        return self._loop.world(0)

    @property
    def sensor(self) -> Frame:
        """Where the LiDAR is."""
        return self._loop.state.sensors.frame(0)

    @property
    def guarded_m(self) -> float:
        """Width of the strip ahead that the driver guards, metres."""
        return self._loop.driving.guarded_m

    @property
    def belief(self) -> Belief:
        """All that a policy may know when it chooses the cells."""
        if self._kept is None or self._kept[0] != self.index:
            loop = self._loop
            tables = loop.state.read[0], loop.arrived[:2], loop.tracks
            ranges = loop.observed["ranges"][0].copy()
            self._kept = self.index, loop.observing.belief(0, *tables, ranges)
        return self._kept[1]

    @property
    def boxes(self) -> Floats:
        """(n, 7) of the ego and then every actor, in the world frame. Truth."""
        return self._loop.boxes(0)

    @property
    def detected_bodies(self) -> Integers:
        """(n,) the body behind each camera detection of the belief, NO_OBJECT behind a false one.
        Truth: for scoring and people.
        """
        # A rendered box lies in the picture, so the limits leave out none but the last, too many.
        bodies: Integers = self._loop.arrived.objects[0, : len(self.belief.detections)].copy()
        return bodies

    def bodies_behind_cells(self) -> Integers:
        """(N,) the body that every cell would return from now, NO_BODY for none. Truth: for
        training alone.
        """
        return self._lidar.bodies(self.sensor)

    def full_scan(self) -> Scan:
        """See `TrueLoop.full_scan`."""
        return self._lidar.peek(self.sensor)

    def would_detect(self, body: int) -> bool:
        """Whether a scan of every cell would give a body the returns that the proxy needs, whatever
        the detector. Truth: for rewards alone.
        """
        return bool(self._loop.would_detect(np.array([body]), ONE_WORLD)[0])

    def shows(self, body: int) -> bool:
        """Whether a camera shows enough of a body for a box. Truth: for scoring and people."""
        return self._loop.shows(0, body)

    def faultless(self, *, as_mounted: bool = False) -> IdentifiedDetections:
        """Return the faultless detections of the cameras as designed, or as they are mounted.
        Truth: for scoring and people.
        """
        world = self.world
        taken = self._loop.sight.detectors.mounted[0] if as_mounted else self.rig.cameras
        labels, engine = world.labels(), self._loop.conditions.engine
        boxes = self._local_boxes([*labels])
        drawn = make_engine(engine, world.bullet, self.rig.grid), taken, self.sensor, boxes
        return faultless_detections(photographed(*drawn), labels)

    @property
    def _lidar(self) -> Lidar:
        """The LiDAR, in the world as it is now. Peeks draw no fault."""
        given = self.world, self.rig, self._loop.conditions, _NO_FAULT
        return self._loop.scanning.lidar(0) or lidar_of(*given)

    def _present(self, objects: Sequence[int]) -> dict[int, Floats]:
        return dict(zip(objects, self._local_boxes(objects), strict=True))

    def _local_boxes(self, bodies: Sequence[int]) -> Floats:
        return self.sensor.boxes_to_local(self._loop.state.bodies.boxes[0, [*bodies]])
