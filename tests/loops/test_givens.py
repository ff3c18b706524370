"""Inputs of a film that no fired cell changes are drawn once for all policies, and anew for other
conditions.
"""

import numpy as np
import pytest

from care_sim.core.conditions import Sensing
from care_sim.loops import givens
from care_sim.loops.episode import SensorSeeds
from tests.loops.test_open_loop import film

FAULTS = {
    "false_negative_rate": 0.5,
    "ego_speed_sigma": 0.5,
    "ego_position_sigma_m": 0.5,
    "camera_latency": 1,
}


def asked(of, seeds=(0, 1), **sensing):
    camera, odometry = map(np.random.SeedSequence, seeds)
    unused = np.random.SeedSequence(9)
    own = SensorSeeds(camera, unused, odometry, unused)
    return givens.givens_of(of, Sensing(**FAULTS | sensing), own)


def told(found):
    return [
        (given.taken_for.x, given.ego.speed, given.arrived.detections.rows().tolist())
        for given in found
    ]


def test_policies_of_a_film_share_one_drawing():
    street = film()
    assert asked(street) is asked(street)


@pytest.mark.parametrize(
    "other",
    [{"seeds": (1, 1)}, {"seeds": (0, 2)}, {"camera_latency": 0}, {"ego_speed_sigma": 0.0}],
)
def test_other_seeds_and_conditions_meet_their_own(other):
    street = film(annotated=(True,) * 12)
    alone = told(asked(street, **other))
    givens._givens.cache_clear()
    first = told(asked(street))
    assert told(asked(street, **other)) == alone != first
    assert told(asked(street)) == first


def test_another_film_has_its_own():
    assert told(asked(film())) != told(asked(film(bend=0.1, annotated=(True,) * 6)))
