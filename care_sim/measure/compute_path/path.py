"""The compute path of a keyframe with many tracks, timed stage by stage.

What the paper calls acquisition lies outside: rays are cast and pictures are drawn between the
stages, untimed.
"""

import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import Any, TypeVar

import gymnasium
import numpy as np

from care_sim.core.actions import scores_of
from care_sim.core.allocation import allocate
from care_sim.core.arrays import Floats
from care_sim.core.belief import Observation
from care_sim.core.conditions import Conditions
from care_sim.core.grid import Cells
from care_sim.core.observation_limits import Limits
from care_sim.core.random_floor import RandomFloor
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand, Detections, Ego
from care_sim.envs.sensing import sensing
from care_sim.measure.bench.choices import TRACKS, seen_by
from care_sim.measure.bench.scanning.casters import EngineCaster
from care_sim.measure.bench.scanning.moving_bodies import SENSOR, moving_bodies
from care_sim.perception.detectors import CLUSTER, make_detector
from care_sim.perception.tracker import TrackMemory
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Cloud, IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.setups import Sensor

CAMERA, DETECTOR, TRACKER, BELIEF, POLICY, ALLOCATION, FIRING = STAGES = (
    "camera hand-over",
    f"detector {CLUSTER}",
    "tracker",
    "belief and observation",
    "policy",
    "allocation",
    "floor and firing",
)
"""In the order of a keyframe, whose first cells are chosen on what the camera shows."""
CHOICE = (POLICY, ALLOCATION, FIRING)
"""The stages that choose cells: a policy's demand, and Algorithm 1."""
SCAN = "scan"
"""Casting the rays that fire; outside of the path."""
_WARM_UP = 5
"""Keyframes that do not count: the first compiles, and tracks have a velocity from the second."""
_SLOWER = 10
"""Bodies sway this much slower than in the measure of scans: at most 0.08 m a keyframe."""
_EGO = Ego(0.0)

_Answer = TypeVar("_Answer")


def compute_path(
    sensor: Sensor, policy: str, budget: float, frames: int, seed: int, detect_every: int = 0
) -> dict[str, Floats]:
    """(frames,) milliseconds of CPU time by stage, keyframe by keyframe, and of the `SCAN`.

    `TRACKS` bodies move around a standing car. At every so many keyframes, if any, the detector
    clusters the returns of the cells that the policy chose; its time is NaN at the others. The
    tracker is handed the boxes of all bodies, so that there are as many tracks whatever was found.
    """
    with gymnasium.make(
        "care_sim:CARE-Dense-v0", disable_env_checker=True, sensor=sensor, budget=budget
    ) as env:
        path = _Path(sensing(env).rig, make_policy(policy, env), seed)
        with closing(path.caster.world):
            spent = [
                path.keyframe(number, bool(detect_every) and _is_due(number, detect_every))
                for number in range(_WARM_UP + frames)
            ][_WARM_UP:]
    return {stage: 1e3 * np.array([each[stage] for each in spent]) for stage in spent[0]}


def _is_due(number: int, detect_every: int) -> bool:
    """Whether the detector runs: all through the warm-up, then from the first that counts on."""
    return number < _WARM_UP or (number - _WARM_UP) % detect_every == 0


class _Path:
    """The stages over one scene."""

    def __init__(self, rig: Rig, policy: Policy, seed: int):
        self._rig = rig
        self._policy = policy
        self._bodies = moving_bodies(TRACKS, seed)
        self.caster = EngineCaster("fast", self._bodies.kinds, rig.grid)
        self._classes = np.arange(TRACKS) % len(CLASSES)
        camera, floor = np.random.SeedSequence(seed).spawn(2)
        self._camera = CameraDetector(
            range(TRACKS), Conditions(), rig.keyframe_s, camera, rig.cameras
        )
        self._detector = make_detector(CLUSTER, rig.sensor_height_m, grid=rig.grid)
        self._memory = TrackMemory(rig.keyframe_s)
        self._limits = Limits(rig)
        self._floors = RandomFloor(floor, 0, rig.grid.size)
        self._fired = np.empty(0, np.int64)
        self._ranges = np.zeros(rig.grid.size, np.float32)

    def keyframe(self, number: int, detects: bool) -> dict[str, float]:
        """CPU seconds of every stage of keyframe `number`, and of its scan."""
        watch = _StageWatch()
        boxes, seen = self._acquired(number)
        arrived = watch(
            CAMERA,
            self._camera.detect,
            seen,
            SENSOR.yaw,
            boxes,
            number * self._rig.keyframe_s,
        )
        tracks = watch(TRACKER, self._memory.tracks, SENSOR)
        image = self._ranges.reshape(self._rig.grid.shape)
        belief = watch(BELIEF, self._limits.belief, _EGO, arrived.detections, tracks, image)
        observation = watch(BELIEF, belief.to_observation)

        # The choice, as `care_sim.policies.base.Policy` and the environments make it.
        demand = watch(POLICY, self._demand, observation)
        reserve = self._rig.reserve_fraction
        cells = watch(ALLOCATION, allocate, demand, self._rig.budget, reserve)
        self._fired = watch(FIRING, self._chosen, cells, number)

        # The rig fires free cells, none of them twice.
        self.caster.place(self._bodies.at(number / _SLOWER))
        ranges, _ = watch(SCAN, self.caster.cast, SENSOR, self._fired)
        cloud = self._returns(ranges)
        if detects:
            watch(DETECTOR, self._detector.detect, cloud, NO_ANNOTATIONS)
        found = Detections(self._classes, boxes, np.full(TRACKS, self._rig.budget))
        watch(TRACKER, self._memory.update, found, SENSOR)
        watch(TRACKER, self._memory.predict)
        return watch.seconds if detects else watch.seconds | {DETECTOR: np.nan}

    def _acquired(self, number: int) -> tuple[Floats, IdentifiedDetections]:
        """Where the bodies stand in the sensor frame (n, 7), and the camera's boxes of them."""
        x, y, heading = self._bodies.at(number / _SLOWER).T
        sizes = np.array([kind.size for kind in self._bodies.kinds])
        placed = np.column_stack([x, y, sizes[:, 2] / 2, sizes, heading])
        boxes = SENSOR.boxes_to_local(placed)
        seen = seen_by(self._rig.cameras[0], boxes, self._classes)
        return boxes, IdentifiedDetections(seen, np.full(len(seen), NO_OBJECT))

    def _demand(self, observation: Observation) -> Demand:
        belief = self._rig.read(observation)
        self._policy.remember(belief)
        return self._policy.demand(belief)

    def _chosen(self, cells: Cells, number: int) -> Cells:
        """What fires: the hardware's choice, and the random floor."""
        scores = scores_of(cells, self._rig.grid.shape)
        floor = partial(self._floors.at, number)
        return self._rig.hardware.fire(scores, self._rig.budget, floor, self._fired)

    def _returns(self, ranges: Floats) -> Cloud:
        """The points of what came back from the cells that fired."""
        self._ranges[:] = 0
        self._ranges[self._fired] = np.minimum(ranges, self._rig.grid.range_m)
        (back,) = np.isfinite(ranges).nonzero()
        cells = self._fired[back]
        points = self._rig.grid.points(cells, ranges[back])
        return Cloud(cells, points, np.full(len(cells), NO_OBJECT))


class _StageWatch:
    """Calls functions and adds the CPU seconds up that they take, in `seconds` by stage.

    What else the machine runs costs a stage no CPU time of its own, or else the tail of a thousand
    keyframes would be that of the scheduler.
    """

    def __init__(self) -> None:
        self.seconds = dict.fromkeys((*STAGES, SCAN), 0.0)

    def __call__(self, stage: str, call: Callable[..., _Answer], *arguments: Any) -> _Answer:
        """What `call` returns; the time that it takes counts for `stage`."""
        started = time.process_time()
        answer = call(*arguments)
        self.seconds[stage] += time.process_time() - started
        return answer
