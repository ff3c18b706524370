"""Where a keyframe's time goes."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.driver_settings import DriverSettings
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.driving.braking import BrakingController
from care_sim.envs.sensing import SensingEnv, sensing
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.perception.proxy import ReturnsRule
from care_sim.perception.tracker import TrackMemory
from care_sim.sensors.camera import (
    CameraDetector,
    Picture,
    class_table,
    faultless_detections,
    window_on,
)
from care_sim.sensors.engines import make_engine
from care_sim.sensors.lidar import Lidar
from care_sim.study.episode_config import EpisodeConfig

POLICY = "policy + allocation"
REST = "the rest"
WHOLE = "whole keyframe"
KEYFRAME_STAGES = (
    "camera",
    "cast",
    "detect",
    "track",
    "control",
    "world step",
    "observation",
)
"""What a keyframe does besides the policy's choice."""

_Answer = TypeVar("_Answer")


class StageTimer:
    """Calls functions and adds their durations up, in `seconds` by stage."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys((POLICY, *KEYFRAME_STAGES), 0.0)

    def __call__(self, stage: str, call: Callable[..., _Answer], *arguments: Any) -> _Answer:
        """What `call` returns; the time that it takes counts for `stage`."""
        started = time.perf_counter()
        answer = call(*arguments)
        self.seconds[stage] += time.perf_counter() - started
        return answer


def stages(config: EpisodeConfig) -> dict[str, float]:
    """Mean milliseconds per keyframe of every stage over one episode without faults; `REST` is what
    no stage holds, `WHOLE` the sum.

    An environment plays the episode, which gives the whole. After each of its keyframes the stages
    of that keyframe are called one by one in a second world of the same seed. So both are measured
    under the same load.
    """
    watch = StageTimer()
    whole = 0.0
    keyframes = 0
    ended = False
    with config.make_env() as env, config.make_env() as twin:
        policy = config.make_policy(env)
        policy.reset()
        observation, _ = env.reset(seed=config.seed)
        twin.reset(seed=config.seed)
        loop = sensing(env).loop
        apart = StageByStage(sensing(twin), watch)
        while not ended:
            ego = loop.belief.ego
            started = time.perf_counter()
            action = watch(POLICY, policy, observation)
            observation, _, terminated, truncated, info = env.step(action)
            whole += time.perf_counter() - started
            apart.keyframe(np.asarray(info["fired"], np.int64), ego)
            watch("observation", loop.belief.to_observation)
            keyframes += 1
            ended = terminated or truncated
    spent = {**watch.seconds, REST: whole - sum(watch.seconds.values()), WHOLE: whole}
    return {name: 1e3 * seconds / keyframes for name, seconds in spent.items()}


class StageByStage:
    """The stages of `care_sim.loops.closed_loop`, one call after another in its order, over the
    world of an environment that was reset and is not stepped.

    Only calls go through `watch`: what the loop does between them belongs to no stage.
    """

    def __init__(self, env: SensingEnv[ClosedLoop], watch: StageTimer):
        self._watch = watch
        self._rig = rig = env.rig
        self.world = world = env.loop.world
        self._sensor = env.loop.sensor
        self._labels = world.labels()
        self._classes = class_table(self._labels)
        self._bodies = np.array(list(self._labels), np.int64)
        # Sensors without faults draw nothing from their seeds, so that any seeds give the episode.
        camera_seed, lidar_seed = np.random.SeedSequence(0).spawn(2)
        self._engine = make_engine(env.conditions.engine, world.bullet, rig.grid)
        self._lidar = Lidar(rig.grid, self._engine, env.conditions, lidar_seed)
        self._camera = CameraDetector(
            list(self._labels), env.conditions, rig.keyframe_s, camera_seed, rig.cameras
        )
        self._returns_rule = ReturnsRule(self._labels, env.conditions.min_returns)
        self._memory = TrackMemory(rig.keyframe_s)
        length, width, _ = world.ego_kind.size
        self._controller = BrakingController(
            world.ego_motion.speed,
            length / 2 - rig.sensor_x_m,
            width / 2,
            rig.keyframe_s,
            DriverSettings(),
        )

    def keyframe(self, fired: Cells, ego: Ego) -> tuple[ImageDetections, Tracks]:
        """Fire `fired` and act on it, the car moving as `ego` says; the camera's detections and the
        forecasts for the next keyframe.
        """
        watch = self._watch

        # From the scan to the brake.
        _, bodies = watch("cast", self._lidar.fire, fired, self._sensor)
        detections, _ = watch("detect", self._returns_rule.detections, bodies, self._local_boxes)
        watch("track", self._memory.update, detections, self._sensor)
        tracks = watch("track", self._memory.tracks, self._sensor)
        command = watch("control", self._controller.command, tracks, ego)

        # The world moves on, and the camera looks at it from the new place.
        watch("world step", self.world.advance, command.acceleration, self._rig.keyframe_s)
        watch("track", self._memory.predict)
        self._sensor = Frame.mounted(self.world.ego.pose, self._rig.sensor_position)
        arrived = self._camera_detections()
        return arrived, watch("track", self._memory.tracks, self._sensor)

    def _camera_detections(self) -> ImageDetections:
        watch = self._watch
        (camera,) = self._rig.cameras
        boxes = self._local_boxes(self._bodies)
        window = window_on(camera, boxes)
        table = watch("camera", self._engine.visible_boxes, camera, self._sensor, window)
        picture = watch("camera", Picture.listed, table)
        seen = faultless_detections([picture], self._classes)
        heading = self._sensor.yaw
        arrived = watch("camera", self._camera.detect, seen, heading, boxes, self.world.time)
        return arrived.detections

    def _local_boxes(self, bodies: Integers) -> Floats:
        return self._sensor.boxes_to_local(self.world.boxes_of(bodies))
