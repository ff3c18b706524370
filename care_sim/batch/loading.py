"""A world as a scenario built it, taken into the tables of a batch."""

from collections.abc import Iterable, Iterator

import numpy as np

from care_sim.batch.state import BatchState, Outlines, Solids, filled
from care_sim.world.bullet import NO_BODY
from care_sim.world.world import World


def load(state: BatchState, world: int, built: World) -> None:
    """Write the tables of a `world` of the batch anew: bodies, parts, classes, the ego; no tracks,
    and keyframe 0.
    """
    state.keyframes[world], state.times[world] = 0, built.time
    target = built.first_sighting
    motion = built.ego_motion
    state.egos.bodies[world] = built.ego_body
    state.egos.targets[world] = NO_BODY if target is None else target.body
    state.egos.speeds[world] = motion.speed
    state.egos.yaw_rates[world] = motion.yaw_rate
    state.egos.accelerations[world] = motion.acceleration
    state.tracks.counts[world] = state.tracks.next_ids[world] = 0

    primitives = built.bullet.primitives
    count = len(primitives.poses)
    boxes = built.boxes_of(np.arange(count))
    state.bodies.counts[world] = count
    bodies = state.bodies
    state.bodies = bodies._replace(
        boxes=filled(bodies.boxes, world, boxes),
        before=filled(bodies.before, world, boxes),
        poses=filled(bodies.poses, world, primitives.poses),
    )
    parts = primitives.tables
    state.solids.counts[world] = len(parts[-1])
    state.solids = Solids(state.solids.counts, *_all_filled(state.solids[1:], world, parts))
    meshes = built.bullet.polyhedra.tables
    state.outlines.counts[world] = len(meshes[-1])
    outlines = _all_filled(state.outlines[1:], world, meshes)
    state.outlines = Outlines(state.outlines.counts, *outlines)

    # Ids count up in the order in which bodies were added, and so do those that are reported.
    labels = built.labels()
    by_body = np.full(count, -1)
    by_body[[*labels]] = [*labels.values()]
    reported = state.reported
    reported.counts[world] = len(labels)
    state.reported = reported._replace(
        bodies=filled(reported.bodies, world, np.array([*labels], np.int64)),
        classes=filled(reported.classes, world, np.array([*labels.values()], np.int64)),
        by_body=filled(reported.by_body, world, by_body),
    )


def _all_filled(
    tables: Iterable[np.ndarray], world: int, columns: Iterable[np.ndarray]
) -> Iterator[np.ndarray]:
    for table, rows in zip(tables, columns, strict=True):
        yield filled(table, world, rows)
