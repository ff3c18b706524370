"""Every environment of the closed loop through the same checks."""

import gc
import pickle
import warnings
import weakref
from dataclasses import dataclass, fields

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.envs import CLOSED_LOOP
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.scenarios.base import Scenario
from care_sim.world.bodies import CATALOGUE
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

EXPLAINED = (
    "symmetric and normalized Box action space",  # scores are shares of attention: 0 to 1
    "unconventional shape",  # tables and the grid are 2D on purpose
)

NOTHING = np.zeros((32, 512), np.float32)
EVERYTHING = np.ones((32, 512), np.float32)


@dataclass(frozen=True)
class BusAhead(Scenario):
    """A bus stands in the way of a car at 10 m/s, too near to stop for."""

    gap_m: float = 6.85

    def build(self, rng):
        world = World(Traffic((1,), 0, 3.5, 14.0), ego_speed=10.0)
        place = (CATALOGUE["ego"].size[0] + CATALOGUE["bus"].size[0]) / 2 + self.gap_m
        world.first_sighting = world.add("bus", "bus", (place, 0.0, 0.0))
        return world


def make(name, **arguments):
    return gymnasium.make(name, disable_env_checker=True, **arguments)


def unexplained(caught):
    messages = [str(warning.message) for warning in caught]
    return [message for message in messages if not any(known in message for known in EXPLAINED)]


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_gymnasium_finds_nothing_to_complain_about(name):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        env = make(name, render_mode="rgb_array", duration_s=1.0)
        check_env(env.unwrapped)
        env.close()
    assert unexplained(caught) == []


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_the_import_name_makes_the_environment_too(name):
    env = gymnasium.make(f"care_sim:{name}", disable_env_checker=True)
    again = gymnasium.make(pickle.loads(pickle.dumps(env.spec)), disable_env_checker=True)
    assert isinstance(again.unwrapped, ClosedLoopEnv)
    assert again.unwrapped.scenario == env.unwrapped.scenario


def test_policies_meet_the_same_floor_world_and_misses():
    fired = []
    seen = []
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


def floors(seed, *actions):
    """The cells that fire at three keyframes without a score, after the keyframes of `actions`."""
    env = make("CARE-Dartout-v0", budget=0.01)
    env.reset(seed=seed)
    for action in actions:
        env.step(action)
    fired = [env.step(NOTHING)[-1]["fired"].tolist() for _ in range(3)]
    env.close()
    return fired


def test_the_floor_of_a_seed_and_keyframe_is_the_same_whatever_was_fired_before():
    some = np.zeros((32, 512), np.float32)
    some[5, :30] = 1.0
    after_nothing = floors(4, NOTHING, NOTHING)
    assert floors(4, some, EVERYTHING) == after_nothing
    assert len({*map(tuple, after_nothing)}) == 3
    assert floors(4)[2] == after_nothing[0]


def braked_by(**driver):
    """When the brake is on and how fast the car is, keyframe by keyframe, behind a standing bus
    15 m ahead.
    """
    env = ScenarioEnv(scenario=BusAhead, gap_m=15.0, budget=1.0, **driver)
    env.reset(seed=0)
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(EVERYTHING)
        over = terminated or truncated
    env.close()
    return [frame.braking for frame in env.keyframes], [frame.speed_mps for frame in env.keyframes]


def test_the_driver_and_its_rules_are_arguments():
    """The controller brakes at once, 15 m being its stopping distance. The careful human evaluates
    for 0.4 s, since the bus is a danger from the start, and brakes 0.75 s later.
    """
    braking, speeds = braked_by()
    assert (braking[0], speeds[:5]) == (True, pytest.approx([10, 10, 10, 10, 9.5]))
    _, harder = braked_by(brake_mps2=8.0, brake_reaction_s=0.1, brake_standstill_m=8.0)
    assert harder[:3] == pytest.approx([10, 10, 9.2])
    braking, speeds = braked_by(driver="careful-human")
    assert braking[:5] == [False] * 4 + [True]
    assert min(speeds[:12]) == 10.0 > speeds[12]


def test_every_condition_stands_on_the_page_of_the_environments():
    names = [field.name for field in fields(ClosedLoopConditions)]
    assert [name for name in names if f"`{name}`" not in ClosedLoopEnv.__doc__] == []


def test_a_contact_ends_the_episode_with_the_speed_it_happened_at():
    """Braking from 0.3 s on covers 3.65 m by 0.70 s, 4.05 m by 0.75 s; 7.75 m/s are left."""
    env = ScenarioEnv(scenario=BusAhead, budget=1.0)
    env.reset(seed=0)
    steps = [env.step(EVERYTHING) for _ in range(8)]
    env.close()
    assert [step[2:4] for step in steps] == [(False, False)] * 7 + [(True, False)]
    assert ["outcome" in step[4] for step in steps] == [False] * 7 + [True]
    outcome = steps[-1][4]["outcome"]
    assert (outcome["collision"], outcome["braked"]) == (True, True)
    assert outcome["impact_speed_mps"] == pytest.approx(7.75)
    assert outcome["rays_fired"] == 8 * 16384
    assert [step[4]["reward_terms"]["collision"] < 0 for step in steps] == [False] * 7 + [True]


def test_a_drive_ends_at_its_goal():
    drive = make("CARE-Drive-v0", budget=0.01).unwrapped
    drive.reset(seed=0)
    world = drive.loop.world
    world.ego.along = world.goal_m - 1.5 * drive.rig.keyframe_s * world.ego.speed
    first, second = (drive.step(NOTHING) for _ in range(2))
    assert (first[2:4], second[2:4]) == ((False, False), (True, False))
    assert second[4]["outcome"]["progress"] >= 1.0
    drive.close()


@pytest.mark.parametrize(
    ("duration", "keyframe", "steps"),
    [(0.3, 0.1, 3), (0.6, 0.2, 3), (0.25, 0.1, 3)],
)
def test_an_episode_is_cut_off_at_its_duration_and_not_a_step_later(duration, keyframe, steps):
    env = make("CARE-Dartout-v0", budget=0.01, duration_s=duration, keyframe_s=keyframe)
    env.reset(seed=0)
    ends = [env.step(NOTHING)[2:] for _ in range(steps)]
    env.close()
    assert [(terminated, truncated) for terminated, truncated, _ in ends] == [(False, False)] * (
        steps - 1
    ) + [(False, True)]
    assert ["outcome" in info for *_, info in ends] == [False] * (steps - 1) + [True]
    assert ends[-1][2]["outcome"]["collision"] is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"budget": 0.0}, "budget must lie in"),
        ({"budget": float("nan")}, "budget must lie in"),
        ({"budget": 1e-5}, "leaves no cell"),
        ({"camera_latency": 0.5}, "camera_latency must be"),
        ({"engine": "magic"}, "unknown engine 'magic'; known: bullet"),
        ({"driver": "magic"}, "unknown driver 'magic'; known: careful-human, fixed"),
        ({"keyframe_s": 0.12}, "multiple of the world step"),
        ({"render_mode": "ascii"}, "render_mode must be"),
        ({"vehicles": 99}, "vehicles of dense must be a whole number >= 0 and <= 12"),
        (
            {"weather": "rain"},
            "unknown argument of DenseEnv 'weather'; known: .*budget, .*, secret, .*, vehicles",
        ),
        ({"vehicle": 3}, "the nearest is vehicles; known: "),
        ({"camera_latncy": 1}, "the nearest is camera_latency; known: "),
        ({"secret": ""}, "secret must not be empty: leave it out, or give False"),
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


@pytest.mark.parametrize("name", ["CARE-NCAP-v0", "CARE-Street-v0"])
def test_reset_takes_no_options(name):
    with (
        gymnasium.make(name, disable_env_checker=True) as env,
        pytest.raises(InvalidInput, match=r"reset takes no options, got \{'test': 'CPNA-25'\}"),
    ):
        env.reset(seed=0, options={"test": "CPNA-25"})


def test_after_an_interrupted_step_the_episode_begins_anew(monkeypatch):
    """The world stands between two keyframes."""
    env = make("CARE-CutIn-v0").unwrapped
    env.reset(seed=0)
    nothing = np.zeros(env.action_space.shape, np.float32)

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as broken:
        broken.setattr(World, "step", interrupted)
        with pytest.raises(KeyboardInterrupt):
            env.step(nothing)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(nothing)
    env.reset(seed=0)
    env.step(nothing)
    env.close()


@pytest.mark.parametrize("name", ["scenario", "rig", "conditions", "reward_weights"])
def test_what_is_fixed_about_an_environment_cannot_be_assigned(name):
    env = make("CARE-CutIn-v0").unwrapped
    with pytest.raises(AttributeError):
        setattr(env, name, getattr(env, name))


def test_a_closed_environment_keeps_no_world():
    env = make("CARE-CutIn-v0").unwrapped
    env.reset(seed=0)
    world = weakref.ref(env.loop.world)
    env.close()
    gc.collect()
    assert world() is None


@dataclass(frozen=True)
class Late(BusAhead):
    """A world that has moved already."""

    def build(self, rng):
        world = super().build(rng)
        world.step(0.0)
        return world


def test_a_world_that_has_moved_already_is_refused():
    with pytest.raises(InvalidInput, match=r"must return a world at 0 s, got one at 0\.05 s"):
        ScenarioEnv(scenario=Late).reset(seed=0)
