"""Every registered environment through the same checks."""

import pickle
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import care_sim
from care_sim.envs import IDS
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.reward import WEIGHTS

EXPLAINED = (
    "symmetric and normalized Box action space",  # a score is a share of attention: 0 to 1, not -1 to 1
    "unconventional shape",  # tables and the grid are 2D on purpose
)


def make(name, **arguments):
    return gymnasium.make(name, disable_env_checker=True, **arguments)


def unexplained(caught):
    messages = [str(warning.message) for warning in caught]
    return [message for message in messages if not any(known in message for known in EXPLAINED)]


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing_to_complain_about(name):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = make(name, render_mode="rgb_array", duration_s=1.0)
        check_env(env.unwrapped)
        env.close()
    assert unexplained(caught) == []


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines3_finds_nothing_to_complain_about(name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = make(name, duration_s=1.0)
        checker.check_env(env.unwrapped)
        env.close()
    assert unexplained(caught) == []


@pytest.mark.parametrize("name", IDS)
def test_an_episode_stays_inside_its_spaces_and_ends(name):
    env = make(name, duration_s=2.0)
    observation, info = env.reset(seed=3)
    assert info == {"seed": 3}
    ended = False
    while not ended:
        assert env.observation_space.contains(observation)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert reward <= 0.0
        assert set(info["reward_terms"]) == set(WEIGHTS)
        assert len(info["fired"]) == env.unwrapped.rig.budget
        ended = terminated or truncated
    assert env.observation_space.contains(observation)
    outcome = info["outcome"]
    assert outcome["rays_fired"] == 20 * env.unwrapped.rig.budget
    assert set(outcome) == {
        "detection_distance_m",
        "braked",
        "min_distance_m",
        "clearance_m",
        "collision",
        "impact_speed_mps",
        "rays_fired",
    }
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_the_import_name_makes_the_environment_too(name):
    env = gymnasium.make(f"care_sim:{name}", disable_env_checker=True)
    again = gymnasium.make(pickle.loads(pickle.dumps(env.spec)), disable_env_checker=True)
    assert isinstance(again.unwrapped, ClosedLoopEnv)
    assert again.unwrapped.scenario == env.unwrapped.scenario


def test_every_environment_documents_itself():
    for name in IDS:
        text = type(make(name).unwrapped).__doc__
        assert name in text
        for heading in ("### Action", "### Observation", "### Reward", "### Episode end", "### Arguments"):
            assert heading in text


def test_fewer_scores_than_cells_are_topped_up_from_the_floor_or_left_unspent():
    mask = np.zeros((32, 512), bool)
    mask[10, :100] = True
    fired = {}
    for floor in (True, False):
        env = make("CARE-Dartout-v0", budget=0.1, floor=floor)
        env.reset(seed=0)
        fired[floor] = env.step(mask)[-1]["fired"]
        env.close()
    chosen = np.flatnonzero(mask)
    np.testing.assert_array_equal(fired[False], chosen)
    assert len(fired[True]) == 1638
    assert set(chosen) <= set(fired[True])


def test_policies_meet_the_same_floor_world_and_misses():
    fired, seen = [], []
    for name in ("random", "history"):
        env = make("CARE-Dartout-v0", false_negative_rate=0.5)
        policy = care_sim.make_policy(name, env)
        observation, _ = env.reset(seed=5)
        for _ in range(5):
            seen.append(observation["detections"])
            observation, *_, info = env.step(policy(observation))
            fired.append(info["fired"])
        env.close()
    np.testing.assert_array_equal(fired[:5], fired[5:])
    np.testing.assert_array_equal(seen[:5], seen[5:])


def test_rendering_changes_nothing():
    scans = []
    for mode in (None, "rgb_array"):
        env = make("CARE-Dense-v0", render_mode=mode)
        env.reset(seed=0)
        env.action_space.seed(0)
        for _ in range(3):
            observation, *_ = env.step(env.action_space.sample())
            picture = env.render()
        scans.append(observation["ranges"])
        env.close()
    np.testing.assert_array_equal(*scans)
    assert picture.dtype == np.uint8
    assert picture.ndim == 3


def test_close_then_reset_and_two_in_one_process():
    first, second = make("CARE-Dense-v0"), make("CARE-Dense-v0")
    before, _ = first.reset(seed=1)
    second.reset(seed=2)
    second.step(second.action_space.sample())
    first.close()
    after, _ = first.reset(seed=1)
    for key in before:
        np.testing.assert_array_equal(before[key], after[key])
    first.close()
    first.close()
    second.step(second.action_space.sample())
    second.close()


def test_step_before_reset_says_so():
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        make("CARE-Dense-v0").unwrapped.step(np.zeros((32, 512), np.float32))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"budget": 0.0}, "budget must lie in"),
        ({"budget": 1.5}, "budget must lie in"),
        ({"budget": float("nan")}, "budget must lie in"),
        ({"budget": 1e-5}, "leaves no cell"),
        ({"reserve_fraction": -0.1}, "reserve_fraction must lie in"),
        ({"false_negative_rate": 1.2}, "false_negative_rate must lie in"),
        ({"camera_latency": -1}, "camera_latency must be"),
        ({"camera_latency": 0.5}, "camera_latency must be"),
        ({"min_returns": 0}, "min_returns must be"),
        ({"lidar_dropout": 2.0}, "dropout must lie in"),
        ({"lidar_range_sigma": -1.0}, "range_sigma"),
        ({"engine": "magic"}, "unknown engine 'magic'; known: bullet"),
        ({"keyframe_s": 0.12}, "multiple of the world step"),
        ({"render_mode": "ascii"}, "render_mode must be"),
        ({"occluder": "cloud"}, "unknown occluder"),
        ({"vehicles": 99}, "vehicles must lie in"),
        ({"weather": "rain"}, "unknown parameter of dense 'weather'; known: "),
        ({"reward_weights": {"speed": 1.0}}, "unknown reward term"),
    ],
)
def test_bad_arguments_get_one_clear_line(arguments, message):
    with pytest.raises(care_sim.InvalidInput, match=message) as caught:
        make("CARE-Dense-v0", **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((512, 32), np.float32), "shape"),
        (np.full((32, 512), np.nan, np.float32), "NaN"),
        (np.full((32, 512), "a"), "numbers"),
    ],
)
def test_bad_actions_get_one_clear_line_and_leave_the_episode_alone(action, message):
    env = make("CARE-Dartout-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(care_sim.InvalidInput, match=message):
        env.step(action)
    assert env.loop.index == 0
    env.close()


def test_reward_weights_can_be_changed():
    env = make("CARE-Dartout-v0", reward_weights={"delay": 7.0}).unwrapped
    assert env._weights["delay"] == 7.0
    assert env._weights["collision"] == WEIGHTS["collision"]
