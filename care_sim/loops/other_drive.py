"""What a camera sees on another drive through the same kind of world: the pool of an episode's
false boxes.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from care_sim.core.conditions import Sensing
from care_sim.core.rig import Rig
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.sensors.false_boxes import BoxPool
from care_sim.world.world import World

NEAR_S = 2.0
"""How far in time a false box may be from the moment it was taken at. A scenario runs by the clock:
a person seen long before anybody can have emerged would be known as false by the time alone. With
less, false boxes would fall on what stands there so often that those which are left would stand out
by their places.
"""


def seen_on_a_drive(
    world: World,
    duration_s: float,
    rig: Rig,
    sensing: Sensing,
    seeds: Sequence[np.random.SeedSequence],
) -> BoxPool:
    """Drive through `world`, every cell fired, and close it: what the camera shows before misses
    and delay.

    It brakes as a full scan makes it brake, whatever the policy: all meet the same false boxes, and
    those of a car that hardly brakes differ a little from its true ones.

    With the `seeds` of an episode its mount errs as the episode's does; false boxes of a straight
    camera would stand out among those of a crooked one.
    """
    with closing(world):
        loop = ClosedLoop(world, rig, replace(sensing, false_positive_rate=0.0), seeds)
        cells, seen, times, over = np.arange(rig.grid.size), [], [], False
        while not over:
            seen.append(loop.seen.detections)
            times.append(world.time)
            over = (
                loop.keyframe(cells).impact_speed_mps is not None or world.time >= duration_s - 1e-9
            )
    return BoxPool.of(seen, times, rig.cameras, near_s=NEAR_S)
