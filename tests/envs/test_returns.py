"""What every switch of the returns keeps to in every loop."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import RETURN_SETTINGS
from care_sim.envs import CLOSED_LOOP
from tests.envs.test_causality import BEHIND, observe
from tests.helpers.short_streets import few_and_short

STATED = {"lidar_stated_range_m": 40.0}
SWITCHES = {
    "signal": STATED,
    "weather": {
        "lidar_stated_range_m": 100.0,
        "lidar_stated_reflectance": 0.8,
        "visibility_m": 60.0,
        "rain_mm_h": 20.0,
    },
    "rolling": {"lidar_sweep_s": 0.1, "lidar_compensated": True},
    "wide": {"lidar_divergence_mrad": 6.0, "lidar_returns": "both"},
    "crosstalk": {"lidar_crosstalk": 0.2},
}
LOOPS = ("CARE-Dense-v0", "CARE-Street-v0")
every_switch = pytest.mark.parametrize("switch", SWITCHES)
every_filmed_switch = pytest.mark.parametrize("switch", [n for n in SWITCHES if n != "crosstalk"])


ALL = {name: value for settings in SWITCHES.values() for name, value in settings.items()}


@pytest.fixture(scope="module", params=LOOPS)
def loop(request):
    with few_and_short(keyframes=4):
        yield request.param


def masks(seed=0, share=0.05):
    rng = np.random.default_rng(seed)
    return [(rng.random((32, 512)) < share).astype(np.float32) for _ in range(3)]


def seen(loop, actions, **settings):
    """Ranges and info of each keyframe."""
    with gymnasium.make(loop, budget=0.1, floor=False, **settings) as env:
        env.reset(seed=3)
        steps = [env.step(action) for action in actions]
        return [(observation["ranges"].copy(), info) for observation, *_, info in steps]


def test_every_setting_is_switched_on_here():
    assert {*ALL} == {*RETURN_SETTINGS}


@every_switch
def test_a_switch_changes_what_returns_and_not_what_fires(loop, switch):
    plain = seen(loop, masks())
    switched = seen(loop, masks(), **SWITCHES[switch])
    assert any(not np.array_equal(a, b) for (a, _), (b, _) in zip(plain, switched, strict=True))
    for (a, before), (b, after) in zip(plain, switched, strict=True):
        assert before["fired"] == after["fired"]
        assert np.array_equal(a > 0, b > 0)


@every_switch
def test_an_episode_repeats_itself(loop, switch):
    first, again = (seen(loop, masks(), **SWITCHES[switch]) for _ in range(2))
    for (a, before), (b, after) in zip(first, again, strict=True):
        assert np.array_equal(a, b)
        assert before == after


@every_switch
def test_a_cell_returns_the_same_whichever_others_fire(loop, switch):
    """Common random numbers, where any are drawn."""
    few, more = masks(), [np.maximum(a, b) for a, b in zip(masks(), masks(1), strict=True)]
    ((one, _),) = seen(loop, few[:1], **SWITCHES[switch])
    ((other, _),) = seen(loop, more[:1], **SWITCHES[switch])
    fired = few[0] > 0
    assert np.array_equal(one[fired], other[fired])


@every_filmed_switch
def test_cells_tell_intensities_beside_what_fired(loop, switch):
    for ranges, info in seen(loop, masks(), **SWITCHES[switch]):
        returned = ranges.ravel()[info["fired"]] < 50
        told = np.array(info["intensities"])
        assert 0 < returned.sum() < len(returned)
        assert np.array_equal(told > 0, returned)
        assert told.max() <= 1
        if "times_s" in info:
            assert np.array_equal(np.array(info["times_s"]) < 0, returned)
        assert ("times_s" in info) == (switch == "rolling")
    assert not {"intensities", "times_s"} & {*seen(loop, masks()[:1])[0][1]}


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_all_together_play_in_every_scenario(name):
    with gymnasium.make(name, budget=0.03, disable_env_checker=True, **ALL) as env:
        policy = care_sim.make_policy("care", env)
        observation, _ = env.reset(seed=0)
        for _ in range(2):
            observation, *_, info = env.step(policy(observation))
        assert len(info["fired"]) == env.unwrapped.rig.budget


@pytest.mark.parametrize("sensor", ["os1-64", "m1-forward"])
def test_all_together_play_with_other_sensors(sensor):
    with gymnasium.make("CARE-Dense-v0", budget=0.03, sensor=sensor, **ALL) as env:
        env.reset(seed=0)
        observation, *_, info = env.step(env.action_space.sample())
        grid = env.unwrapped.rig.grid
        told = observation["ranges"].ravel()[info["fired"]] < np.float32(grid.range_m)
        assert 0 < told.sum() < len(told)
        assert np.array_equal(info["times_s"] < 0, told)


@every_switch
def test_moving_what_nobody_looks_at_changes_nothing(switch):
    forward = np.zeros((32, 512), bool)
    forward[:, 192:320] = True
    near, far = (
        observe("CARE-Dense-v0", pose, forward, **SWITCHES[switch])[0]
        for pose in (BEHIND, (-30.0, -1.0, 0.5))
    )
    for before, after in zip(near, far, strict=True):
        for key in before:
            np.testing.assert_array_equal(before[key], after[key])


@every_switch
def test_both_engines_return_alike(switch):
    fast, bullet = (
        seen("CARE-Dense-v0", masks(), engine=engine, **SWITCHES[switch])
        for engine in ("fast", "bullet")
    )
    for (a, _), (b, _) in zip(fast, bullet, strict=True):
        assert (np.abs(a - b) > 0.01).mean() < 1e-3


@every_switch
def test_firing_nothing_returns_nothing(switch):
    ((ranges, info),) = seen("CARE-Dense-v0", [np.zeros((32, 512))], **SWITCHES[switch])
    assert not ranges.any()
    assert info["fired"] == []


def test_vectors_give_the_same_episodes():
    """With every switch on, in this process and in others."""
    with gymnasium.make("CARE-Dense-v0", disable_env_checker=True, **ALL) as env:
        observations = [env.reset(seed=3)[0], *(env.step(mask)[0] for mask in masks())]
    for mode in ("sync", "async"):
        arguments = {"num_envs": 2, "vectorization_mode": mode} | ALL
        with closing(gymnasium.make_vec("CARE-Dense-v0", **arguments)) as envs:
            stacked = [envs.reset(seed=[3, 4])[0]]
            stacked += [envs.step(np.stack([mask, mask]))[0] for mask in masks()]
            for one, many in zip(observations, stacked, strict=True):
                for key in one:
                    assert np.array_equal(one[key], many[key][0])


def test_vectors_stack_what_returns_tell():
    arguments = {"num_envs": 2, "vectorization_mode": "sync", "budget": 0.01}
    with closing(gymnasium.make_vec("CARE-Dense-v0", **arguments, **STATED)) as envs:
        envs.reset(seed=0)
        *_, info = envs.step(envs.action_space.sample())
        assert info["intensities"].shape == info["fired"].shape == (2, 164)


def test_recordings_take_crosstalk(drive):
    """A ghost needs no surface."""
    source = f"argoverse2:{drive.parent}"
    plain, haunted = (
        seen("CARE-Replay-v0", masks(), source=source, **given)
        for given in ({}, SWITCHES["crosstalk"])
    )
    assert all((a != b).any() for (a, _), (b, _) in zip(plain, haunted, strict=True))


@every_filmed_switch
def test_recordings_refuse_what_they_do_not_hold(drive, switch):
    name = next(name for name in RETURN_SETTINGS if name in SWITCHES[switch])
    told = f"{name} cannot be changed of the film .*, which was made with {RETURN_SETTINGS[name]}"
    with pytest.raises(InvalidInput, match=told):
        gymnasium.make("CARE-Replay-v0", source=f"argoverse2:{drive.parent}", **SWITCHES[switch])


def test_a_sweep_that_outlasts_a_keyframe_is_refused():
    with pytest.raises(InvalidInput, match=r"lidar_sweep_s must be at most the 0\.1 s between"):
        gymnasium.make("CARE-Dense-v0", lidar_sweep_s=0.2)
    gymnasium.make("CARE-Street-v0", lidar_sweep_s=0.2).close()
