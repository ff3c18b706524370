"""Inputs of each keyframe of a film that no fired cell changes: camera detections, motion and pose.

All policies of a film meet the same inputs, so these are drawn once for all of them.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.types import Ego
from care_sim.driving.localisation import Localisation, Odometry
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.false_box_pools import pool_of_film
from care_sim.loops.film import Film
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.camera_profiles import invents_boxes
from care_sim.sensors.false_boxes import EMPTY_POOL


class Given(NamedTuple):
    """Inputs of a keyframe. `taken_for` is where the car takes its sensor to be. `ego` is its own
    motion as its odometry reads it. `arrived` are camera detections, with the truth behind them.
    """

    taken_for: Frame
    ego: Ego
    arrived: IdentifiedDetections


_Stream = tuple[Any, tuple[int, ...]]
"""A stream of random numbers: what `numpy.random.SeedSequence` is made of."""


def givens_of(film: Film, sensing: Sensing, seeds: SensorSeeds) -> tuple[Given, ...]:
    """Return what each keyframe of a film gives. The last answer is kept."""
    camera, odometry = ((seed.entropy, seed.spawn_key) for seed in (seeds.camera, seeds.odometry))
    return _givens(film, sensing, camera, odometry)


# All policies of a film meet the same, and they are mostly played one after the other.
@lru_cache(maxsize=1)
def _givens(film: Film, sensing: Sensing, camera: _Stream, odometry: _Stream) -> tuple[Given, ...]:
    of_camera, of_car = (
        np.random.SeedSequence(entropy, spawn_key=key) for entropy, key in (camera, odometry)
    )
    pool = pool_of_film(film) if invents_boxes(sensing) else EMPTY_POOL
    # The camera errs object by object, so it needs all objects of the film.
    numbers = np.unique([each for shot in film.shots for each in shot.annotations.objects])
    detector = CameraDetector(
        numbers.tolist(), sensing, film.keyframe_s, of_camera, film.cameras, pool
    )
    own_motion = Odometry(sensing.ego_speed_sigma, of_car)
    localisation = Localisation(sensing, film.keyframe_s, of_car)
    givens = []
    for shot in film.shots:
        localisation.advance()
        taken_for = localisation.taken_for(shot.sensor)
        # Zero boxes of absent objects: their distance would begin a burst of misses, into which
        # their appearance would fall.
        boxes = np.zeros((len(numbers), 7))
        boxes[np.searchsorted(numbers, shot.annotations.objects)] = shot.annotations.boxes
        arrived = detector.detect(shot.seen, taken_for.yaw, boxes, shot.time_s)
        givens.append(Given(taken_for, own_motion.reading(shot.ego), arrived))
    return tuple(givens)
