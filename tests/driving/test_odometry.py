import numpy as np
import pytest

from care_sim.core.types import Ego
from care_sim.driving.localisation import Odometry

MOTION = Ego(8.0, 0.1, -1.0)


def odometry(sigma, seed=0):
    return Odometry(sigma, np.random.SeedSequence(seed))


def test_without_noise_it_reads_what_is():
    assert odometry(0.0).reading(MOTION) == MOTION


def test_noise_is_on_the_speed_alone_and_seeded():
    one, again, other = odometry(0.5), odometry(0.5), odometry(0.5, seed=1)
    readings = [one.reading(MOTION) for _ in range(2000)]
    assert {(reading.yaw_rate, reading.acceleration) for reading in readings} == {(0.1, -1.0)}
    speeds = np.array([reading.speed for reading in readings])
    assert (speeds.mean(), speeds.std()) == pytest.approx((8.0, 0.5), rel=0.05)
    assert again.reading(MOTION) == readings[0] != other.reading(MOTION)


def test_noise_never_turns_the_way_that_the_car_goes():
    noisy = odometry(0.5)
    assert min(noisy.reading(Ego(0.1)).speed for _ in range(200)) > 0
    backwards = [noisy.reading(Ego(-0.1)).speed for _ in range(200)]
    assert max(backwards) < 0
    assert min(backwards) < -0.5


def test_no_speed_of_a_standing_car_is_exact():
    """Cut at 0, every second reading would be the truth."""
    noisy = odometry(0.5)
    speeds = np.array([noisy.reading(Ego(0.0)).speed for _ in range(2000)])
    assert speeds.min() > 0
    assert len(np.unique(speeds)) == len(speeds)
    assert speeds.mean() == pytest.approx(0.5 * np.sqrt(2 / np.pi), rel=0.05)
