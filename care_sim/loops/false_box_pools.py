"""Where the false boxes of an episode come from: another drive, or another time of the film."""

from contextlib import closing
from dataclasses import replace
from functools import lru_cache

import numpy as np

from care_sim.base.times import LAST_BITS_S
from care_sim.core.conditions import IDEAL_CAMERA, RETURN_SETTINGS, ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Film
from care_sim.loops.one_world import OneWorld
from care_sim.perception.points_only import Detector
from care_sim.sensors.false_boxes import BoxPool
from care_sim.world.world import World

NEAR_S = 2.0
"""How far in time a false box of a drive may be from the time that it was taken at. A scenario runs
by the clock: a person seen long before anybody can have emerged would be known as false by the time
alone. With less, false boxes would fall on what is there so often that those which are left would
be known by their places.
"""
APART_S = 3.0
"""A film's own boxes become false ones this long before and after they were true. At 30 km/h a
standing object is 25 m nearer by then, and the car has passed one that was 20 m away.
"""


def pool_of_another_drive(
    world: World,
    duration_s: float,
    rig: Rig,
    conditions: ClosedLoopConditions,
    seeds: SensorSeeds,
    detector: Detector | None = None,
) -> BoxPool:
    """Drive through `world`, every cell fired, and close it: return the camera's boxes before
    misses and delay.

    The car brakes as a full scan in clear air makes it brake, every pulse a plain ray. Episodes
    with any policy and any returns therefore meet the same false boxes. The true boxes of a car
    that hardly brakes differ a little from them.

    With the `seeds` of an episode its mount errs as the episode's does: false boxes of a straight
    camera would be known among those of a crooked one.
    """
    with closing(world):
        ideal = replace(
            conditions,
            false_positive_rate=0.0,
            camera_profile=IDEAL_CAMERA,
            **RETURN_SETTINGS,
        )
        loop = OneWorld.begun(world, rig, ideal, seeds, duration_s, detector=detector)
        cells = np.arange(rig.grid.size)
        seen = []
        times_s = []
        over = False

        # The picture is taken before each keyframe, as in the episode.
        while not over:
            seen.append(loop.faultless(as_mounted=True))
            times_s.append(loop.world.time)
            hit = loop.keyframe(cells).impact_speed_mps is not None
            over = hit or loop.world.time >= duration_s - LAST_BITS_S
    return BoxPool.of(seen, times_s, rig.cameras, near_s=NEAR_S)


# All episodes of a film have one pool, and they are mostly played one after the other.
@lru_cache(maxsize=1)
def pool_of_film(film: Film) -> BoxPool:
    """All boxes of a film. In a short one those are usable that are half of it away, so that every
    keyframe has some.
    """
    # From every time of a film of the length T, one of its ends is at least T / 2 away.
    times_s = [shot.time_s for shot in film.shots]
    apart_s = min(APART_S, (times_s[-1] - times_s[0]) / 2)
    seen = [shot.seen for shot in film.shots]
    return BoxPool.of(seen, times_s, film.cameras, apart_s)
