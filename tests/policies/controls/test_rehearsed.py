"""The actions of an agent that has played the scenario before, unless there is a secret."""

from contextlib import closing
from dataclasses import dataclass

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.selection import expanded
from care_sim.core.rig import Rig
from care_sim.policies import contenders, policy_names, tags_of
from care_sim.policies.controls.rehearsed import LearnedPlace, SeedFinder, learned_cells, rehearsal
from care_sim.scenarios import make_scenario
from care_sim.scenarios.base import Scenario
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.motions import Crosser, Meeting, Walk
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

GRID = Rig().grid


def hull_when_a_full_scan_finds_the_actor(seed, **parameters):
    with closing(gymnasium.make("CARE-Dartout-v0", budget=1.0, **parameters)) as env:
        env.reset(seed=seed)
        loop, info = env.unwrapped.loop, {"detected": False}
        while not info["detected"]:
            boxes = loop.sensor.boxes_to_local(loop.world.boxes([loop.world.first_sighting]))
            *_, info = env.step(np.ones(GRID.shape, np.float32))
        (hull,) = env.unwrapped.rig.hulls(boxes)
        return hull


def test_of_one_seed_it_fires_where_the_full_scan_first_finds_the_actor():
    hull = hull_when_a_full_scan_finds_the_actor(10_000)
    cells = learned_cells(Rig(), "dartout", 1)
    assert sorted(cells[: len(hull)]) == sorted(hull)
    assert sorted(cells) == [*range(GRID.size)]


def test_the_cells_that_held_most_actors_come_first():
    """At speeds so different they are found near and far, in many cells and in few."""
    speeds = {"ego_speed_mps": (4.0, 14.0)}
    hulls = [hull_when_a_full_scan_finds_the_actor(10_000 + n, **speeds) for n in range(3)]
    held = [sum(cell in hull for hull in hulls) for cell in range(GRID.size)]
    assert {*held} == {0, 1, 2, 3}
    found = learned_cells(Rig(), make_scenario("dartout", **speeds), 3)
    assert [held[cell] for cell in found] == sorted(held, reverse=True)


@pytest.mark.parametrize(("mirrored", "side"), [("never", -1), ("always", 1)])
def test_it_is_told_the_scenario_of_its_environment_with_its_parameters(mirrored, side):
    with closing(gymnasium.make("CARE-CutIn-v0", budget=0.03, mirrored=mirrored)) as env:
        policy = care_sim.make_policy("learned-place", env, seeds=2)
        env.reset(seed=0)
        cells = policy.demand(env.unwrapped.loop.belief).layers[0][0][:50]
        assert np.array_equal(np.sign(GRID.directions[cells][:, 1]), np.full(50, side))
        told = learned_cells(env.unwrapped.rig, make_scenario("cutin", mirrored=mirrored), 2)
        assert np.array_equal(cells, told[:50])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [({"scenario": "moon"}, "unknown scenario 'moon'"), ({"seeds": 0}, "seeds must be")],
)
def test_what_is_not_known_is_refused(parameters, message):
    with pytest.raises(InvalidInput, match=message):
        LearnedPlace(Rig(), **parameters)


BLIND = {"budget": 0.03, "false_negative_rate": 1.0}
ENVIRONMENTS = {"dartout": "CARE-Dartout-v0", "dense": "CARE-Dense-v0", "cutin": "CARE-CutIn-v0"}


@pytest.fixture
def make():
    envs = []

    def made(scenario="dense", **arguments):
        envs.append(gymnasium.make(ENVIRONMENTS[scenario], disable_env_checker=True, **arguments))
        return envs[-1]

    yield made
    for env in envs:
        env.close()


def played(env, name, seed=3, watch=lambda *_: None, **parameters):
    """The outcome, `watch` having seen every action before it was taken."""
    policy = care_sim.make_policy(name, env, **parameters)
    observation, _ = env.reset(seed=seed)
    policy.reset()
    ended = False
    while not ended:
        action = policy(observation)
        watch(policy, observation, action)
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    return info["outcome"]


@pytest.mark.parametrize("scenario", ENVIRONMENTS)
def test_it_finds_the_seed_and_expects_the_hidden_one_where_it_is_even_when_the_car_brakes(
    make, scenario
):
    env = make(scenario, budget=0.2)
    braked = []

    def watch(policy, observation, _):
        loop = env.unwrapped.loop
        (true,) = loop.sensor.boxes_to_local(loop.world.boxes([loop.world.first_sighting]))
        (expected,) = policy._expected()
        # The twin brakes as the car does, but for the half keyframe in which the car comes to rest.
        np.testing.assert_allclose(expected, true, atol=0.05)
        assert policy.found == 3
        braked.append(observation["ego"][2] < -1)

    played(env, "seed-finder", watch=watch, scenario=scenario)
    assert any(braked)


def test_blind_it_is_as_early_as_the_full_scan_and_with_a_secret_it_is_history(make):
    full = played(make(budget=1.0), "full")
    finder = played(make(**BLIND), "seed-finder")
    assert finder["detection_distance_m"] > full["detection_distance_m"] - 0.5
    secret = {**BLIND, "secret": "a secret"}
    history = care_sim.make_policy("history", make(**secret))

    def watch(policy, observation, action):
        assert policy.found is None
        np.testing.assert_array_equal(action, history(observation))

    closed = played(make(**secret), "seed-finder", watch=watch)
    assert closed == played(make(**secret), "history")


@pytest.mark.parametrize("known", [{"seeds": 3}, {"scenario": "cutin", "seeds": 3}])
def test_a_seed_that_it_does_not_know_is_played_as_history(make, known):
    env = make(**BLIND)
    finder = care_sim.make_policy("seed-finder", env, **known)
    history = care_sim.make_policy("history", env)
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(finder(observation), history(observation))
    assert finder.found is None


@pytest.mark.parametrize("scenario", ENVIRONMENTS)
def test_it_knows_the_scenario_of_its_environment(make, scenario):
    env = make(scenario, budget=0.03)
    observation, _ = env.reset(seed=9)
    told = care_sim.make_policy("seed-finder", env, scenario=scenario)
    own = care_sim.make_policy("seed-finder", env)
    np.testing.assert_array_equal(own(observation), told(observation))
    assert own.found == 9


def test_in_a_drive_it_knows_all_whom_the_ego_is_to_meet():
    env = gymnasium.make("care_sim:CARE-Drive-v0", disable_env_checker=True, budget=0.01)
    with env:
        finder = care_sim.make_policy("seed-finder", env, seeds=14, hidden_first=True)
        observation, _ = env.reset(seed=13)
        finder.reset()
        for _ in range(8):
            loop = env.unwrapped.loop
            met = [one.body for one in loop.world.meetings]
            true = loop.sensor.boxes_to_local(loop.world.boxes_of(np.array(met)))
            # One is near, the other beyond the reach of the sensor.
            (near,) = true[np.hypot(true[:, 0], true[:, 1]) <= 50]
            assert len(met) == 2
            action = finder(observation)
            np.testing.assert_allclose(finder._expected(), [near], atol=0.05)
            observation, *_ = env.step(action)


@dataclass(frozen=True)
class ThreeBesideTheWay(Scenario):
    """Three people stand 6, 20 and 54 m down the way of an ego that drives on at 10 m/s."""

    def build(self, rng):
        world = World(Traffic((1,), 0, 3.5, 14.0), 10.0)
        for x in (6.0, 20.0, 54.0):
            body = world.add("adult", "adult", (x, -3.0, 0.0)).body
            waits = Crosser(Walk((x, -3.0), 0.0, 1.0, 1.0, 1.0), 0.0, lambda _walk: False)
            world.meetings.append(
                Meeting(body, "adult", "right", x, "straight", "stop", "hedge", False, waits)
            )
        return world


def test_whom_it_has_passed_and_who_is_out_of_reach_it_leaves_out():
    """A keyframe is a metre of the way. The sensor begins 0.445 m before it and reaches 50 m."""
    rig = Rig(cameras=(FRONT_CAMERA,), budget=100)
    finder = SeedFinder(rig, ThreeBesideTheWay(), seeds=1)
    loop = rehearsal(ThreeBesideTheWay(), 0, rig)
    expected = []
    for _ in range(24):
        finder.remember(loop.belief)
        places = finder._expected()[:, 0] + loop.sensor.x
        expected.append(places.round(3).tolist())
        loop.keyframe(np.array([], np.int64))
    finder.reset()
    loop.world.close()
    assert expected[:5] == [[6.0, 20.0]] * 5
    assert expected[5:7] == [[6.0, 20.0, 54.0]] * 2
    assert expected[7:21] == [[20.0, 54.0]] * 14
    assert expected[21:] == [[54.0]] * 3


def test_of_seeds_that_share_a_speed_it_takes_the_one_whose_picture_it_sees(make):
    """The vehicles of the dense street are never in the same places; of the dart-out, where the
    first picture is empty, it takes the first seed."""
    for scenario, found in (("dense", 3), ("dartout", 0)):
        env = make(scenario, budget=0.03, ego_speed_mps=(8.0, 8.0))
        finder = care_sim.make_policy("seed-finder", env)
        observation, _ = env.reset(seed=3)
        finder(observation)
        assert finder.found == found


def test_it_may_ask_for_the_hidden_one_before_its_tracks(make):
    """At 1% the hulls of the dense street's tracks leave the hidden one 49 of its cells."""
    env = make("dense", budget=0.01)

    def watch(policy, observation, action):
        (hidden,) = policy.rig.hulls(policy._expected())
        first = hidden[: policy.rig.budget]
        assert action.ravel()[first].all()

    played(env, "seed-finder", watch=watch, hidden_first=True)


def test_all_leaves_controls_out_unless_they_are_named():
    assert "control" in tags_of("seed-finder")
    assert contenders() == [name for name in policy_names() if "control" not in tags_of(name)]
    assert expanded(["all", "seed-finder", "care"], contenders()) == [*contenders(), "seed-finder"]
    assert expanded(["care"], contenders()) == ["care"]
