"""How long a policy takes to choose its cells with many tracks around."""

import time
from itertools import cycle, islice

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks
from tests.bench.casters import SENSOR, moving_bodies
from tests.bench.environments import EPISODE, by_name, driven

TRACKS = 40
UNTRACKED = 10
"""Further bodies, which the camera may see and no track explains."""
OBSERVATIONS = 20
"""Different observations; the choices go through them in turn."""
FASTEST_MPS = 14.0
"""50 km/h."""


def choices(settings):
    """Milliseconds from an observation to the action, `p50` and `p99`, in every round."""
    with driven() as env:
        env.reset(seed=EPISODE.seed)
        rig = env.get_wrapper_attr("rig")
        shown = [observation(rig, EPISODE.seed + number) for number in range(OBSERVATIONS)]
        rounds = [_round(env.policy, shown, settings.samples) for _ in range(settings.repeats)]
    return by_name(rounds)


def _round(policy, observations, samples):
    spent = []
    for seen in islice(cycle(observations), samples):
        started = time.perf_counter()
        policy(seen)
        spent.append(1e3 * (time.perf_counter() - started))
    p50, p99 = np.percentile(spent, (50, 99)).tolist()
    return {"p50": p50, "p99": p99}


def observation(rig, seed):
    """The observation that environments show of `TRACKS` tracked bodies and `UNTRACKED` others
    around the sensor.
    """
    rng = np.random.default_rng(seed)
    bodies = moving_bodies(TRACKS + UNTRACKED, seed)
    x, y, heading = bodies.poses.T
    sizes = np.array([kind.size for kind in bodies.kinds])
    boxes = SENSOR.boxes_to_local(np.column_stack([x, y, sizes[:, 2] / 2, sizes, heading]))
    # The classes come in turn, as `moving_bodies` makes the bodies.
    classes = np.arange(len(boxes)) % len(CLASSES)
    directions = np.column_stack([np.cos(heading), np.sin(heading)])
    velocities = rng.uniform(0, FASTEST_MPS, len(boxes))[:, None] * directions

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


def seen_by(camera, boxes, classes):
    """Every box that reaches into the picture, cut at its edge; nothing hides anything."""
    edges = (camera.width, camera.height) * 2
    pictured = np.clip(camera.project_boxes(boxes), 0, edges)
    (rows,) = np.nonzero((pictured[:, 0] < pictured[:, 2]) & (pictured[:, 1] < pictured[:, 3]))
    nothing = np.zeros(len(rows))
    ids = np.zeros(len(rows), np.int64)
    return ImageDetections(classes[rows], nothing + 0.9, pictured[rows], ids, nothing, nothing)
