import gymnasium
import numpy as np
import pytest

from care_sim.core.conditions import Conditions
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Detections, Ego
from care_sim.driving.localisation import Localisation, Odometry
from care_sim.perception.tracker import TrackMemory

SENSOR = Frame(10.0, -4.0, 1.84, 0.5)
KEYFRAME_S = 0.1


def errors(keyframes, seed=0, **spreads):
    """(keyframes, 3) errors in x, y and yaw."""
    sensing = Conditions(**spreads)
    localisation = Localisation(sensing, KEYFRAME_S, np.random.SeedSequence(seed))
    found = []
    for _ in range(keyframes):
        taken = localisation.taken_for(SENSOR)
        assert (taken.z, taken.roll, taken.pitch) == (SENSOR.z, 0.0, 0.0)
        found.append((taken.x - SENSOR.x, taken.y - SENSOR.y, taken.yaw - SENSOR.yaw))
        localisation.advance()
    return np.array(found)


def correlation(of, keyframes):
    """The correlation of a series with itself so many keyframes later."""
    return float(np.corrcoef(of[:-keyframes], of[keyframes:])[0, 1])


def test_without_an_error_the_pose_is_the_very_one():
    exact = Localisation(
        Conditions(ego_pose_correlation_s=5.0), KEYFRAME_S, np.random.SeedSequence(0)
    )
    exact.advance()
    assert exact.taken_for(SENSOR) is SENSOR


@pytest.mark.parametrize("correlation_s", [0.0, 0.2])
def test_the_spread_is_that_of_the_condition_however_long_errors_last(correlation_s):
    found = errors(
        10_000,
        ego_position_sigma_m=0.4,
        ego_yaw_sigma_deg=2.0,
        ego_pose_correlation_s=correlation_s,
    )
    np.testing.assert_allclose(found.std(axis=0), [0.4, 0.4, np.deg2rad(2.0)], rtol=0.06)


def test_errors_are_correlated_by_the_exponential_of_the_time_between():
    anew = errors(10_000, ego_position_sigma_m=1.0)[:, 0]
    lasting = errors(10_000, ego_position_sigma_m=1.0, ego_pose_correlation_s=0.2)[:, 0]
    assert correlation(anew, 1) == pytest.approx(0.0, abs=0.03)
    assert correlation(lasting, 1) == pytest.approx(np.exp(-0.5), abs=0.03)
    assert correlation(lasting, 3) == pytest.approx(np.exp(-1.5), abs=0.05)


def played(**conditions):
    """The episode's observations and the closed loop, with every cell fired."""
    arguments = {"budget": 1.0, "disable_env_checker": True, **conditions}
    with gymnasium.make("care_sim:CARE-Dense-v0", **arguments) as env:
        seen = [env.reset(seed=0)[0]]
        scores = np.ones(env.action_space.shape, np.float32)
        for _ in range(8):
            seen.append(env.step(scores)[0])
            loop = env.unwrapped.loop
            yield seen[-1], loop, loop.true_boxes(loop.belief.tracks)


def test_the_forecast_of_a_standing_object_is_off_by_three_errors():
    """Seen at e0 and e1 and forecast to e2 at constant velocity, it is 2 e1 - e0 - e2 away from
    where it is: nothing for an error that stays, of variance 6 sigma^2 for one drawn anew.
    """
    sensing = Conditions(ego_position_sigma_m=0.2)
    localisation = Localisation(sensing, KEYFRAME_S, np.random.SeedSequence(0))
    memory = TrackMemory(KEYFRAME_S)
    standing = Detections(
        np.array([0]), np.array([[8.0, 3.0, -1.0, 4.0, 1.8, 1.5, 0.0]]), np.array([9])
    )
    taken = []
    for _ in range(2):
        taken.append(localisation.taken_for(SENSOR))
        memory.update(standing, taken[-1])
        memory.predict()
        localisation.advance()
    taken.append(localisation.taken_for(SENSOR))
    forecast = memory.tracks(taken[-1]).boxes[0, :2]
    e0, e1, e2 = (np.array([one.x - SENSOR.x, one.y - SENSOR.y]) for one in taken)
    off = turned(2 * e1 - e0 - e2, -SENSOR.yaw)
    np.testing.assert_allclose(forecast - standing.boxes[0, :2], off, atol=1e-12)


def test_the_truth_stays_where_it_is():
    """Distances, and what is scored, are those of the true pose."""
    for _, loop, _ in played(ego_position_sigma_m=5.0):
        assert loop.sensor == Frame.mounted(loop.world.ego.pose, loop.rig.sensor_position)


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
