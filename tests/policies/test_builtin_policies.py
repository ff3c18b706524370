"""What sets the policies of the closed loop apart: history, camera reserves, forgetting, the two
bounds.
"""

import inspect
from dataclasses import asdict

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.forgetting import ForgettingRules
from care_sim.core.rig import Rig
from care_sim.core.types import Ego
from care_sim.envs import CLOSED_LOOP
from care_sim.policies.paper.reserves import CareSbf

CAMERA_POLICIES = ["care", "all-camera", "care-priority", "care-sbf"]


def made(scenario, policy="care", budget=0.05, **parameters):
    env = gymnasium.make(scenario, budget=1.0 if policy == "full" else budget, **parameters)
    return env, care_sim.make_policy(policy, env)


def driven(scenario, policy, keyframes=60, seed=0, **parameters):
    """Observations, actions and infos of the first keyframes of an episode."""
    env, chooses = made(scenario, policy, **parameters)
    observation, _ = env.reset(seed=seed)
    chooses.reset()
    history = []
    for _ in range(keyframes):
        action = chooses(observation)
        following, _, terminated, truncated, info = env.step(action)
        history.append((observation, action, info))
        observation = following
        if terminated or truncated:
            break
    env.close()
    return history


@pytest.mark.slow
@pytest.mark.parametrize("scenario", CLOSED_LOOP)
@pytest.mark.parametrize("policy", ["care", "care-priority", "all-camera"])
def test_with_a_camera_that_misses_everything_episodes_are_those_of_history(scenario, policy):
    blind = driven(scenario, policy, false_negative_rate=1.0)
    history = driven(scenario, "history", false_negative_rate=1.0)
    # A test of Euro NCAP may be over before its six seconds are.
    assert len(blind) == len(history)
    assert len(blind) == 60 or scenario == "CARE-NCAP-v0"
    for (_, _, one), (_, _, other) in zip(blind, history, strict=True):
        assert np.array_equal(one["fired"], other["fired"])


def test_history_ignores_what_the_camera_sees():
    seeing = driven("CARE-Dense-v0", "history", 40)
    blind = driven("CARE-Dense-v0", "history", 40, false_negative_rate=1.0)
    assert all(
        np.array_equal(a["fired"], b["fired"])
        for (_, _, a), (_, _, b) in zip(seeing, blind, strict=True)
    )


def test_care_differs_from_all_camera_only_by_what_tracks_explain(encounter, environment):
    """Where everything is explained, CARE is history; where nothing is, it is the all-camera
    reserve.
    """
    care, everything, history = (
        care_sim.make_policy(n, environment) for n in ("care", "all-camera", "history")
    )
    no_tracks = np.zeros_like(encounter[0]["tracks"])
    no_tracks[:, 0] = -1
    for observation in encounter:
        untracked = {**observation, "tracks": no_tracks}
        assert np.array_equal(care(untracked), everything(untracked))
    assert any(np.array_equal(care(o), history(o)) for o in encounter)
    assert any(not np.array_equal(care(o), everything(o)) for o in encounter)


def test_random_asks_for_nothing(encounter, environment):
    chooses = care_sim.make_policy("random", environment)
    assert not any(chooses(observation).any() for observation in encounter)


def test_full_asks_for_everything_and_refuses_another_budget(environment):
    env, full = made("CARE-Dartout-v0", "full")
    observation, _ = env.reset(seed=0)
    assert np.all(full(observation) > 0)
    env.close()
    with pytest.raises(InvalidInput, match=r"full needs .*budget=1\.0.*819 of 16384"):
        care_sim.make_policy("full", environment)


def test_history_demands_the_hulls_nearest_first(environment, belief_of, car):
    history = care_sim.make_policy("history", environment)
    rig = environment.unwrapped.rig
    belief = belief_of([car(0, 10), car(1, 20, 5), car(2, 40, -5)])
    hulls = rig.grid.hulls(belief.tracks.boxes)
    assert [s.tolist() for s in history.demand(belief).exploitation] == [
        hull.tolist() for hull in hulls
    ]
    assert not any(len(layer) for layer in history.demand(belief).layers)


def test_forgetting_serves_full_hulls_before_shrunk_ones_and_keeps_the_elevation_pad(
    environment, belief_of, car
):
    sbf = care_sim.make_policy("care-sbf", environment)
    rig = environment.unwrapped.rig
    belief = belief_of([car(0, 10), car(1, 20, 5, vy=3.0), car(2, 30, -5)])
    sbf.reset()
    for _ in range(5):
        sbf.remember(belief)
    demand = sbf.demand(belief)
    near, moving, far = belief.tracks.boxes
    bare_near, bare_far = rig.grid.hulls([near, far], 0)
    (full_moving,) = rig.grid.hulls([moving])
    assert [cells.tolist() for cells in demand.exploitation] == [
        full_moving.tolist(),
        bare_near.tolist(),
        bare_far.tolist(),
    ]


def test_the_parameters_of_forgetting_are_its_rules_with_their_defaults():
    rig, *rules = inspect.signature(CareSbf).parameters.values()
    assert rig.name == "rig"
    assert {rule.name: rule.default for rule in rules} == asdict(ForgettingRules())


def test_parameters_of_forgetting_reach_the_rules(environment, belief_of, car):
    belief = belief_of([car(0, 10)], Ego(8.0))
    guarded, unguarded = (
        care_sim.make_policy("care-sbf", environment, **p) for p in ({}, {"k_safe": 0.0})
    )
    for _ in range(5):
        guarded.remember(belief)
        unguarded.remember(belief)
    kept, dropped = (policy.demand(belief).exploitation for policy in (guarded, unguarded))
    assert len(kept[0]) > len(dropped[0])


@pytest.mark.parametrize(
    ("name", "parameters", "named"),
    [
        (
            "clairvoyant",
            {},
            r"policy 'clairvoyant'; known: all-camera, beam-reduce, care, care-priority",
        ),
        ("care", {"boldness": 2}, "boldness"),
        ("care-sbf", {"k_save": 2}, r"'k_save'.*k_safe"),
    ],
)
def test_unknown_policies_and_parameters_are_refused_by_name(name, parameters, named, environment):
    with pytest.raises(InvalidInput, match=named):
        care_sim.make_policy(name, environment, **parameters)


def test_another_environment_is_refused():
    with pytest.raises(InvalidInput, match="needs an environment of CARE-Sim"):
        care_sim.make_policy("care", gymnasium.make("CartPole-v1"))


def test_the_reserve_fraction_of_the_environment_is_obeyed():
    env, history = made("CARE-Dense-v0", "history", reserve_fraction=1.0)
    observation, _ = env.reset(seed=0)
    for _ in range(5):
        observation, *_ = env.step(history(observation))
    assert (observation["tracks"][:, 0] >= 0).any()
    assert not history(observation).any()
    env.close()


@pytest.mark.parametrize("policy", CAMERA_POLICIES)
def test_an_action_is_the_allocation_of_the_demand(policy, encounter, environment):
    acting, asking = (care_sim.make_policy(policy, environment) for _ in range(2))
    rig: Rig = environment.unwrapped.rig
    for observation in encounter:
        belief = Belief.from_observation(observation)
        asking.remember(belief)
        cells = allocate(asking.demand(belief), rig.budget, rig.reserve_fraction)
        assert set(np.flatnonzero(acting(observation)).tolist()) == set(cells.tolist())
