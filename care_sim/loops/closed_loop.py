"""One keyframe of the closed loop: fire, detect, track, act, let the world move, look."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.belief import Belief, range_image
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.conditions import ClosedLoopConditions, Sensing
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.core.types import Detections, Scan, Tracks
from care_sim.driving.corridor import along_route
from care_sim.driving.drivers import Cruising, CruisingRules, make_driver
from care_sim.driving.localisation import Localisation, Odometry
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.gathering import Gathering, acted_on
from care_sim.loops.needless import NeedlessBraking, UnfoundedBraking
from care_sim.loops.observation_limits import Limits
from care_sim.loops.records import Keyframe, Sight
from care_sim.loops.truth import Told, TrackObjects, told_by
from care_sim.perception.matching import found_objects
from care_sim.perception.points_only import Detector
from care_sim.perception.proxy import ReturnsRule
from care_sim.perception.tracker import MemoryRules, TrackMemory
from care_sim.sensors.annotated import (
    NO_OBJECT,
    Annotations,
    IdentifiedDetections,
    cloud_of,
    pointless_cloud,
)
from care_sim.sensors.beams import Beams
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.engines import Engine, make_engine
from care_sim.sensors.false_boxes import EMPTY_POOL, BoxPool
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.pictures import class_table, faultless_detections, is_shown
from care_sim.world.approach import ClosestApproach
from care_sim.world.world import WORLD_STEP_S, World


class Cameras:
    """The cameras of a `rig` in a world, whose pictures an engine draws, and their detector.

    The scoring sees the world through the cameras as designed, the detector through those that are
    mounted; without an error of the mount the same pictures serve both.
    """

    pictures: tuple[Integers, ...]
    """The table of boxes (`care_sim.sensors.pictures`) of each camera as it was designed. Truth:
    for scoring and people.
    """
    seen: IdentifiedDetections
    """What the cameras as they are mounted show, before misses, false boxes and delay. Truth: for
    scoring and people.
    """

    after_s: float
    """Seconds from a keyframe to the pictures that the detector is given, 0 at the keyframe."""

    def __init__(
        self,
        world: World,
        rig: Rig,
        engine: Engine,
        sensing: Sensing,
        seed: np.random.SeedSequence,
        pool: BoxPool,
    ):
        labels = world.labels()
        self._world = world
        self._designed = rig.cameras
        self._engine = engine
        self._classes = class_table(labels)
        self._bodies = np.array(list(labels), np.int64)
        self._detector = CameraDetector(
            list(labels), sensing, rig.keyframe_s, seed, rig.cameras, pool, step_s=WORLD_STEP_S
        )
        self.after_s = self._detector.timing.after_s

    def look(self, sensor: Frame, heading: float) -> IdentifiedDetections:
        """Take the pictures of a keyframe, the LiDAR at `sensor` and the car taken to have the
        `heading`: the newest detections that are due.
        """
        boxes = sensor.boxes_to_local(self._world.boxes_of(self._bodies))
        self.pictures = taken = self._photographed(self._designed, sensor, boxes)
        if self._detector.mounted != self._designed:
            taken = self._photographed(self._detector.mounted, sensor, boxes)
        self.seen = faultless_detections(taken, self._classes)
        if not self.after_s:
            self._detector.take(self.seen, heading, boxes, self._world.time)
        return self._detector.newest(heading)

    def look_between(self, sensor: Frame, heading: float) -> None:
        """Take the pictures that the detector is given, `after_s` after a keyframe; see `look`."""
        boxes = sensor.boxes_to_local(self._world.boxes_of(self._bodies))
        taken = self._photographed(self._detector.mounted, sensor, boxes)
        seen = faultless_detections(taken, self._classes)
        self._detector.take(seen, heading, boxes, self._world.time)

    def shows(self, body: int) -> bool:
        """Whether a camera shows enough of a body for a box. Truth: for scoring and people."""
        return any(is_shown(table, body) for table in self.pictures)

    def faultless(self) -> IdentifiedDetections:
        """What a detector without faults would report of the cameras as designed. Truth: for
        scoring and people.
        """
        return faultless_detections(self.pictures, self._classes)

    def _photographed(
        self, cameras: tuple[PinholeCamera, ...], sensor: Frame, boxes: Floats
    ) -> tuple[Integers, ...]:
        """The pictures around boxes (n, 7) of all that the detector may ever report, in the sensor
        frame.
        """
        windows = [(camera, camera.window_on(boxes)) for camera in cameras]
        return tuple(self._engine.visible_boxes(camera, sensor, at) for camera, at in windows)


class ClosedLoop:
    """A world, the sensors and the car's software over the keyframes of one episode.

    Without a `detector` the paper's proxy detects what enough fired rays hit. Its attributes are of
    the coming keyframe: they change with every call of `keyframe`.
    """

    index: int
    """The number of the coming keyframe, from 0."""
    sensor: Frame
    """Where the LiDAR is."""
    belief: Belief
    """All that a policy may know when it chooses the cells."""
    cameras: Cameras
    """The cameras, and what they show. Truth: for scoring and people."""
    detected_bodies: Integers
    """(n,) the body behind each camera detection of the belief, NO_OBJECT behind a false one.
    Truth: for scoring and people.
    """
    guarded_m: float
    """Width of the strip ahead that the driver guards, metres."""
    told: Told
    """What the returns of the last keyframe told besides their ranges."""

    def __init__(
        self,
        world: World,
        rig: Rig,
        conditions: ClosedLoopConditions,
        seeds: SensorSeeds,
        pool: BoxPool = EMPTY_POOL,
        detector: Detector | None = None,
    ):
        self.world = world
        self.rig = rig
        engine = make_engine(conditions.engine, world.bullet, rig.grid)
        beams = (
            Beams(world.bullet, rig.grid, conditions, conditions.engine, world.linear_motion)
            if conditions.shapes_beams
            else None
        )
        self._lidar = Lidar(rig.grid, engine, conditions, seeds.lidar, beams)
        self.cameras = Cameras(world, rig, engine, conditions, seeds.camera, pool)
        self._odometry = Odometry(conditions.ego_speed_sigma, seeds.odometry)
        self._localisation = Localisation(conditions, rig.keyframe_s, seeds.odometry)
        labels = world.labels()
        self._reported = np.array([*labels], np.int64)
        self._classes = np.array([*labels.values()], np.int64)
        # By number of a body: itself, or NO_OBJECT for what is not reported. The last place is that
        # of NO_BODY, the one before stands for all higher numbers.
        self._named = np.full(int(self._reported.max(initial=0)) + 3, NO_OBJECT)
        self._named[self._reported] = self._reported
        self._returns_rule = ReturnsRule(labels, conditions.min_returns)
        self._detector = (
            None if detector is None else detector.begin(seeds.detector, rig, is_filmed=False)
        )
        self._gathering = (
            Gathering(detector.gathers, rig.keyframe_s)
            if detector and detector.gathers > 1
            else None
        )
        self._min_returns = conditions.min_returns
        self._limits = Limits(rig)
        followed = MemoryRules(velocity_keyframes=conditions.velocity_keyframes)
        self._memory = TrackMemory(rig.keyframe_s, followed)
        self._track_objects = TrackObjects()
        # The driver reckons from where the sensor stands along the car: the front bumper is farther
        # from a sensor behind the middle than half a length.
        length, width, _ = world.ego_kind.size
        front_m = length / 2 - rig.sensor_x_m
        cruise_mps = world.ego_motion.speed
        # Where somebody may come towards the ego into its way, the scenario asks for foresight.
        rules = replace(
            conditions, brake_for_oncoming=conditions.brake_for_oncoming or world.has_oncoming
        )
        self._driver = make_driver(rules, cruise_mps, front_m, width / 2, rig.keyframe_s)
        self.guarded_m = self._driver.guarded_m
        plan = world.speed_plan
        comfort = CruisingRules(comfort_mps2=conditions.comfort_mps2)
        self._cruising = (
            Cruising(plan, front_m, width / 2, rig.keyframe_s, comfort) if plan else None
        )
        # The outcome of a drive alone tells of it, and it asks the truth about every body.
        self._needless = NeedlessBraking(front_m, self.guarded_m / 2, conditions) if plan else None
        # The proxy reports bodies alone. Another detector may make one up.
        self._unfounded = (
            None if detector is None else UnfoundedBraking(front_m, self.guarded_m / 2, conditions)
        )
        self.index = 0
        self.told = {}
        self._look(np.zeros(rig.grid.shape, np.float32))

    def keyframe(self, fired: Cells) -> Keyframe:
        """Fire `fired`, act on what came back, and move on to the next keyframe."""
        # What is recorded of the scan is taken before the world moves on.
        world, sensor, target = self.world, self.sensor, self.world.first_sighting
        index, time, speed = self.index, world.time, world.ego_motion.speed
        in_view, distance = False, float("inf")
        if target is not None:
            in_view = self.shows(target.body)
            x, y = world.centre_of(target.body)
            distance = float(np.hypot(x - sensor.x, y - sensor.y))

        # The scan, the detector and the tracker see the world as it was when the cells were chosen.
        scan, bodies = self._lidar.fire(fired, sensor)
        self.told = told_by(fired, scan.cells, scan.intensities, scan.times)
        detections, behind, found = self._detect(scan, bodies)
        tracked = self._memory.update(detections, self._localisation.taken_for(sensor))
        self._track_objects.note(tracked, behind)

        # The driver reckons from the middle line of the car, along the way that it is to go.
        middle = sensor
        if self.rig.sensor_y_m:
            x, _, z = self.rig.sensor_position
            middle = Frame.mounted(world.ego.pose, (x, 0.0, z))
        taken_for, ego = self._localisation.taken_for(middle), self.belief.ego
        tracks = self._memory.tracks(taken_for)
        ahead = tracks if world.route is None else along_route(tracks, world.route, taken_for)
        command = self._driver.command(ahead, ego)
        if self._cruising is not None:
            command = self._cruising.eased(command, ahead, ego.speed, world.along_m)
        needless = self._needless is not None and self._needless.judge(
            world, middle, command.braking
        )
        unfounded = self._unfounded is not None and self._unfounded.judge_tracks(
            world, middle, tracks, ahead, command.braking, in_view, behind
        )
        sights = self._sights(found) if world.meetings else ()

        # The command holds until the next keyframe; then the camera looks and forecasts are due.
        passage = self._advance(command.acceleration)
        self.index += 1
        self._memory.predict()
        grid = self.rig.grid
        image = range_image(grid.size, scan.cells, scan.ranges, float(grid.range_m))
        self._look(image.reshape(grid.shape))

        # What was near, or was hit, is of the time since the scan; the rest is of the scan itself.
        return Keyframe(
            index=index,
            time_s=time,
            fired=fired,
            in_view=in_view,
            detected=target is not None and target.body in found,
            braking=command.braking,
            speed_mps=speed,
            distance_m=distance,
            nearest_m=passage.nearest_m,
            clearance_m=passage.clearance_m,
            impact_speed_mps=passage.impact_speed_mps,
            impact=passage.impact,
            sights=sights,
            needless=needless,
            unfounded=unfounded,
        )

    def true_boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) where the objects behind forecasts are now, in the sensor frame; a track without
        an object keeps its forecast. Truth: for the privileged alone.
        """
        return self._track_objects.boxes(
            tracks,
            lambda bodies: dict(
                zip(bodies, self._local_boxes(np.array(bodies, np.int64)), strict=True)
            ),
        )

    def true_objects(self, tracks: Tracks) -> Integers:
        """(n,) the bodies behind tracks, NO_OBJECT for a track without one. Truth: for training
        alone.
        """
        return self._track_objects.behind(tracks)

    def bodies_behind_cells(self) -> Integers:
        """(N,) the body that every cell would return from now, NO_BODY for none. Truth: for
        training alone.
        """
        return self._lidar.bodies(self.sensor)

    def full_scan(self) -> Scan:
        """What every cell would return now, before noise and dropout. Truth: for the privileged
        alone.
        """
        return self._lidar.peek(self.sensor)

    def detectable(self) -> bool:
        """Whether `would_detect` holds of the first-sighting actor, if perception reports it.

        Truth: for the reward alone.
        """
        target = self.world.first_sighting
        return target is not None and target.label is not None and self.would_detect(target.body)

    def would_detect(self, body: int) -> bool:
        """Whether a scan of every cell would give a body the returns that the proxy needs, whatever
        the detector.

        Truth: for rewards alone.
        """
        # No cell outside its hull can hit it, so these stand for all.
        (cells,) = self.rig.hulls(self._local_boxes(np.array([body], np.int64)))
        return self._lidar.hits(body, cells, self.sensor) >= self._min_returns

    def shows(self, body: int) -> bool:
        """Whether a camera shows enough of a body for a box. Truth: for scoring and people."""
        return self.cameras.shows(body)

    def _detect(self, scan: Scan, bodies: Integers) -> tuple[Detections, Integers, Integers]:
        """The detections, the body behind each or NO_OBJECT, and all bodies that were found; of the
        returns of `bodies`.

        The proxy alone may ask whose return each is. What another detector finds is scored by the
        class-consistent 2 m match (paper, Remark 1), and only what a box has returns of: else a box
        on the end of a lorry would find who is hidden behind it.
        """
        if self._detector is None:
            detections, detected = self._returns_rule.detections(bodies, self._local_boxes)
            return detections, detected, detected
        objects = self._named[np.minimum(bodies, len(self._named) - 2)]
        cloud = (
            cloud_of(scan, objects, self.rig.grid)
            if self._detector.wants_points
            else pointless_cloud(scan, objects)
        )
        boxes = self._local_boxes(self._reported)
        present = Annotations(self._reported, self._classes, boxes)
        if self._gathering is not None:
            cloud = self._gathering.add(cloud, self._localisation.taken_for(self.sensor))
        self._detector.at(None, self.sensor)
        detections, behind = self._detector.detect(cloud, present)
        if self._detector.track_score:
            sure = acted_on(detections, self._detector.track_score)
            if not sure.all():
                detections, behind = detections.take(sure), behind[sure]
        if self._detector.is_matched:
            return detections, behind, behind[behind != NO_OBJECT]
        hit = (present.objects[:, None] == behind).any(axis=1)
        candidates = Annotations(present.objects[hit], present.classes[hit], present.boxes[hit])
        found = found_objects(candidates, detections)
        return detections, behind, candidates.objects[found]

    def _advance(self, acceleration: float) -> ClosestApproach:
        """Let the world move on to the next keyframe, and the cameras take their pictures on the
        way if their latency asks for it.
        """
        after_s = self.cameras.after_s
        if not after_s:
            return self.world.advance(acceleration, self.rig.keyframe_s)
        before = self.world.advance(acceleration, after_s)
        sensor = Frame.mounted(self.world.ego.pose, self.rig.sensor_position)
        self.cameras.look_between(sensor, self._localisation.taken_for(sensor).yaw)
        rest = self.world.advance(acceleration, self.rig.keyframe_s - after_s)
        return ClosestApproach.over([before, rest])

    def _look(self, ranges: NDArray[np.float32]) -> None:
        """Let the cameras look, and form the belief on which the next cells are chosen."""
        self._localisation.advance()
        self.sensor = Frame.mounted(self.world.ego.pose, self.rig.sensor_position)

        # The boxes that arrive, late and with errors, and the forecasts: all that is known when the
        # next cells are chosen.
        taken_for = self._localisation.taken_for(self.sensor)
        arrived = self.cameras.look(self.sensor, taken_for.yaw)
        ego = self._odometry.reading(self.world.ego_motion)
        tracks = self._memory.tracks(taken_for)
        self.belief = self._limits.belief(ego, arrived.detections, tracks, ranges)
        # A rendered box lies in the picture, so the limits leave out none but the last, too many.
        self.detected_bodies = arrived.objects[: len(self.belief.detections)]

    def _local_boxes(self, bodies: Integers) -> Floats:
        return self.sensor.boxes_to_local(self.world.boxes_of(bodies))

    def _sights(self, detected: Integers) -> tuple[Sight, ...]:
        """Whom the scenario lets the ego meet, at this scan."""
        bodies = [one.body for one in self.world.meetings]
        ranges = planar_ranges(self._local_boxes(np.array(bodies, np.int64)))
        return tuple(
            Sight(distance, self.shows(body), body in detected)
            for body, distance in zip(bodies, ranges.tolist(), strict=True)
        )
