"""How long a policy takes to choose its cells with many tracks around."""

import time
from collections.abc import Callable
from itertools import cycle, islice
from typing import Any

import numpy as np

from care_sim.core.allocation import allocate
from care_sim.core.arrays import Floats
from care_sim.core.belief import Belief, Observation
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Demand, Ego, ImageDetections, Tracks
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.scanning.moving_bodies import SENSOR, moving_bodies
from care_sim.measure.driven import driven
from care_sim.policies.base import Policy

TRACKS = 40
_UNTRACKED = 10
"""Further bodies, which the camera may see and no track explains."""
_OBSERVATIONS = 20
"""Different observations; the choices go through them in turn."""
_FASTEST_MPS = 14.0
"""50 km/h."""


def choices(config: BenchConfig) -> dict[str, list[float]]:
    """Milliseconds per choice in every round.

    `p50` and `p99` are those of the time from an observation to the action; `demand` and
    `allocation` are the medians of its parts.
    """
    with driven(config.episode) as env:
        env.reset(seed=config.seed)
        rig = env.get_wrapper_attr("rig")
        observations = [observation(rig, config.seed + number) for number in range(_OBSERVATIONS)]
        rounds = [_round(env.policy, observations, config.samples) for _ in range(config.repeats)]
    return {name: [figures[name] for figures in rounds] for name in rounds[0]}


def observation(rig: Rig, seed: int) -> Observation:
    """What the environments show of `TRACKS` tracked bodies and `_UNTRACKED` others around the
    sensor.
    """
    rng = np.random.default_rng(seed)
    bodies = moving_bodies(TRACKS + _UNTRACKED, seed)
    x, y, heading = bodies.poses.T
    sizes = np.array([kind.size for kind in bodies.kinds])
    boxes = SENSOR.boxes_to_local(np.column_stack([x, y, sizes[:, 2] / 2, sizes, heading]))
    # The classes come in turn, as `moving_bodies` makes the bodies.
    classes = np.arange(len(boxes)) % len(CLASSES)
    velocities = rng.uniform(0, _FASTEST_MPS, len(boxes))[:, None] * np.column_stack(
        [np.cos(heading), np.sin(heading)]
    )

    # The tracks are a random choice of them, nearest first as the tracker gives them.
    tracked = np.sort(rng.permutation(len(boxes))[:TRACKS])
    tracked = tracked[np.argsort(np.hypot(x[tracked], y[tracked]))]
    tracks = Tracks(
        ids=np.arange(TRACKS),
        classes=classes[tracked],
        boxes=boxes[tracked],
        velocities=velocities[tracked],
        misses=np.zeros(TRACKS, np.int64),
        hits=np.full(TRACKS, 5),
    )
    detections = seen_by(rig.cameras[0], boxes, classes)
    empty = np.zeros(rig.grid.shape, np.float32)
    return Belief(Ego(8.0), rig.budget, detections, tracks, empty).to_observation()


def seen_by(camera: PinholeCamera, boxes: Floats, classes: np.ndarray) -> ImageDetections:
    """Every box that reaches into the picture, cut at its edge; nothing hides anything."""
    edges = (camera.width, camera.height) * 2
    pictured = np.clip(camera.project_boxes(boxes), 0, edges)
    (rows,) = np.nonzero((pictured[:, 0] < pictured[:, 2]) & (pictured[:, 1] < pictured[:, 3]))
    nothing = np.zeros(len(rows))
    return ImageDetections(
        classes[rows],
        nothing + 0.9,
        pictured[rows],
        np.zeros(len(rows), np.int64),
        nothing,
        nothing,
    )


def _round(policy: Policy, observations: list[Observation], samples: int) -> dict[str, float]:
    """Milliseconds of the whole and of its parts, over the same observations."""
    # The whole comes first and undisturbed. Then each part is measured on its own.
    shown = list(islice(cycle(observations), samples))
    whole = [_seconds(policy, observation) for observation in shown]
    beliefs = [policy.rig.read(observation) for observation in shown]
    demand = [_seconds(_asked, policy, belief) for belief in beliefs]
    reserve = policy.rig.reserve_fraction
    allocation = [
        _seconds(allocate, policy.demand(belief), belief.budget, reserve) for belief in beliefs
    ]
    p50, p99 = np.percentile(whole, (50, 99)).tolist()
    return {
        "p50": 1e3 * p50,
        "p99": 1e3 * p99,
        "demand": 1e3 * float(np.median(demand)),
        "allocation": 1e3 * float(np.median(allocation)),
    }


def _asked(policy: Policy, belief: Belief) -> Demand:
    """A policy's demand at a new keyframe."""
    policy.remember(belief)
    return policy.demand(belief)


def _seconds(call: Callable[..., Any], *arguments: Any) -> float:
    started = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - started
