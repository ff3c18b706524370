import gymnasium
import numpy as np
import pytest

from care_sim.core.conditions import Conditions
from care_sim.core.frames import Frame, turned
from care_sim.core.types import Detections
from care_sim.driving.localisation import Localisation
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
    """Of a series with itself so many keyframes later."""
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


def test_an_error_that_outlasts_the_drive_walks_at_random():
    """The spread after n keyframes grows as the square root of n."""
    walks = np.array(
        [
            errors(41, seed, ego_position_sigma_m=50.0, ego_pose_correlation_s=1e5)[:, 0]
            for seed in range(400)
        ]
    )
    away = walks - walks[:, :1]
    step = 50.0 * np.sqrt(2 * KEYFRAME_S / 1e5)
    assert away[:, 10].std() == pytest.approx(np.sqrt(10) * step, rel=0.1)
    assert away[:, 40].std() == pytest.approx(np.sqrt(40) * step, rel=0.1)


def test_one_spread_leaves_the_other_error_as_it_is():
    both = errors(5, ego_position_sigma_m=0.4, ego_yaw_sigma_deg=2.0)
    position = errors(5, ego_position_sigma_m=0.4)
    np.testing.assert_array_equal(position[:, :2], both[:, :2])
    assert not position[:, 2].any()


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


def forecast_errors(**conditions):
    """(n,) metres in the plane, of the forecasts from the third keyframe on."""
    found = [
        np.hypot(*(loop.belief.tracks.boxes - true)[:, :2].T)
        for _, loop, true in played(**conditions)
    ]
    return np.concatenate(found[2:])


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


def test_in_the_loop_an_error_that_stays_moves_no_forecast():
    exact = forecast_errors()
    stays = forecast_errors(ego_position_sigma_m=0.05, ego_pose_correlation_s=1e6)
    anew = forecast_errors(ego_position_sigma_m=0.05)
    assert np.median(np.abs(stays - exact)) < 0.01
    assert np.median(np.abs(anew - exact)) > 0.05


def test_a_heading_that_is_off_by_a_constant_moves_no_forecast():
    """Standing tracks: both the scan and the forecast are read in the same wrong axes."""
    stays = forecast_errors(ego_yaw_sigma_deg=3.0, ego_pose_correlation_s=1e6)
    anew = forecast_errors(ego_yaw_sigma_deg=3.0)
    assert np.median(anew) > 4 * np.median(stays)


def test_the_truth_stays_where_it_is():
    """Distances, and what is scored, are those of the true pose."""
    for _, loop, _ in played(ego_position_sigma_m=5.0):
        assert loop.sensor == Frame.mounted(loop.world.ego.pose, loop.rig.sensor_position)
