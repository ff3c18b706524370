"""Truth has a door of its own: who is handed it, what its holders do with it, and that nobody else
reaches it.
"""

import itertools
import sys
from typing import ClassVar

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.core.belief import Belief
from care_sim.loops.one_world import OneWorld
from care_sim.policies import BUILT_IN, tags_of
from care_sim.policies.base import PrivilegedPolicy
from care_sim.policies.paper.blind import FarthestPoints
from care_sim.world.bullet import BulletWorld
from care_sim.world.world import World

PRIVILEGED = ["history-oracle", "random-points", "farthest-points"]
TWIN = "seed-finder"
"""It holds a world that it has built by itself."""
ORDINARY = [name for name in BUILT_IN if name not in (*PRIVILEGED, "full", TWIN)]


def reachable(thing, seen=None):
    """Everything that can be reached from an object through attributes and containers."""
    seen = {} if seen is None else seen
    if id(thing) in seen:
        return seen
    seen[id(thing)] = thing
    if isinstance(thing, dict):
        parts = [*thing, *thing.values()]
    elif isinstance(thing, list | tuple | set | frozenset):
        parts = list(thing)
    else:
        parts = [*getattr(thing, "__dict__", {}).values(), getattr(thing, "__self__", None)]
    for part in parts:
        reachable(part, seen)
    return seen


def knows(policy):
    """Whether an environment, a simulation or truth can be reached from a policy."""
    inside = (gymnasium.Env, OneWorld, World, BulletWorld)
    return any(isinstance(o, inside) or hasattr(o, "full_scan") for o in reachable(policy).values())


def used(name, environment, encounter):
    """A policy that has acted a few times."""
    environment.reset(seed=0)
    policy = care_sim.make_policy(name, environment)
    for observation in encounter[:3]:
        policy(observation)
    return policy


@pytest.mark.parametrize("name", [*ORDINARY, "random-points"])
def test_a_privileged_policy_alone_can_reach_truth(name, environment, encounter):
    assert knows(used(name, environment, encounter)) == (name in PRIVILEGED)


def test_a_twin_is_no_part_of_the_environment(environment, encounter):
    policy = used(TWIN, environment, encounter)
    reached = reachable(policy).values()
    (twin,) = (thing for thing in reached if isinstance(thing, World))
    world = environment.unwrapped.loop.world
    assert twin is not world
    assert twin.bullet is not world.bullet
    assert not any(isinstance(thing, gymnasium.Env | OneWorld) for thing in reached)


def test_tags():
    assert [name for name in BUILT_IN if "causal" not in tags_of(name)] == [
        *PRIVILEGED,
        "seed-finder",
    ]
    assert tags_of("history-oracle") == ("privileged",)
    assert tags_of("random-points") == tags_of("farthest-points") == ("non-causal",)


@pytest.mark.parametrize(
    ("claimed", "told"),
    [
        (("causal",), ("privileged",)),
        (("causal", "learned", "non-causal"), ("learned", "non-causal")),
    ],
)
def test_a_privileged_policy_never_counts_as_causal(claimed, told):
    class Claims(PrivilegedPolicy):
        tags = claimed

    assert Claims.tags == told


class Cloaked(BUILT_IN["history-oracle"]):
    """A policy that changes its tags when nobody looks."""


Cloaked.tags = ("causal",)


def test_tags_that_change_later_do_not_hide_that_truth_is_handed_over():
    assert tags_of(f"{__name__}:Cloaked") == ("privileged",)


class Listening(BUILT_IN["history"]):
    """A policy that keeps the scenario."""

    told: ClassVar = {"scenario": "scenario"}

    def __init__(self, rig, scenario=None):
        super().__init__(rig)
        self.scenario = scenario


def test_a_policy_is_told_the_fields_of_a_scenario_and_nothing_that_it_keeps(environment):
    scenario = environment.unwrapped.scenario
    object.__setattr__(scenario, "kept", environment)
    told = care_sim.make_policy(f"{__name__}:Listening", environment).scenario
    assert told == scenario
    assert not hasattr(told, "kept")


def test_truth_is_no_parameter(environment):
    with pytest.raises(
        InvalidInput, match="truth of policy history-oracle comes from the environment"
    ):
        care_sim.make_policy("history-oracle", environment, truth=None)
    with pytest.raises(InvalidInput, match="truth"):
        care_sim.make_policy("history", environment, truth=None)


def test_the_oracle_covers_where_the_tracked_objects_will_be():
    """True boxes read off the world; each track's hull is that of the actor nearest to its
    forecast.
    """
    env = gymnasium.make("CARE-CutIn-v0", budget=0.1)
    oracle, history = (care_sim.make_policy(name, env) for name in ("history-oracle", "history"))
    observation, _ = env.reset(seed=0)
    loop = env.unwrapped.loop
    differs = 0
    reported = [actor for actor in loop.world.actors if actor.label is not None]
    for _ in range(45):
        belief = Belief.from_observation(observation)
        boxes = loop.sensor.boxes_to_local(loop.world.boxes(reported))
        distance = np.hypot(*(belief.tracks.boxes[:, None, :2] - boxes[None, :, :2]).T).T
        true = boxes[distance.argmin(axis=1)] if len(belief.tracks) else boxes[:0]
        expected = oracle.rig.hulls(true[np.argsort(np.hypot(*true[:, :2].T), kind="stable")])
        demand = oracle.demand(belief)
        assert [cells.tolist() for cells in demand.exploitation] == [
            hull.tolist() for hull in expected
        ]
        assert not any(len(layer) for layer in demand.layers)
        differs += not np.array_equal(oracle(observation), history(observation))
        observation, *_ = env.step(history(observation))
    env.close()
    assert differs


@pytest.mark.usefixtures("open3d")
@pytest.mark.parametrize(
    ("privileged", "budget"), [("random-points", 0.03), ("farthest-points", 0.35)]
)
def test_references_keep_exactly_the_matched_fraction_of_the_points(privileged, budget):
    """P is counted in the picture of a full scan of the same moment, the kept points in the next
    observation.
    """
    sampled, whole = (gymnasium.make("CARE-Dense-v0", budget=b) for b in (budget, 1.0))
    policy = care_sim.make_policy(privileged, sampled)
    observation, _ = sampled.reset(seed=0)
    whole.reset(seed=0)
    full, *_ = whole.step(np.ones(whole.action_space.shape, np.float32))
    observation, *_ = sampled.step(policy(observation))
    cells = sampled.unwrapped.rig.budget
    reach = sampled.unwrapped.rig.grid.range_m
    points = np.count_nonzero(full["ranges"] < reach)
    returned = (observation["ranges"] > 0) & (observation["ranges"] < reach)
    assert np.count_nonzero(returned) == round(cells * points / full["ranges"].size)
    assert np.count_nonzero(observation["ranges"]) == cells
    sampled.close()
    whole.close()


def test_random_points_are_drawn_anew_for_every_cloud_and_seed(environment):
    """Two independent draws of a share b of the points have the share b of each in common."""
    policy, other = (
        care_sim.make_policy("random-points", environment, seed=seed) for seed in (0, 1)
    )
    share = environment.unwrapped.rig.budget / environment.unwrapped.rig.grid.size

    def common(ours, theirs):
        return len(np.intersect1d(ours, theirs)) / len(ours)

    def draw(policy, seed):
        observation, _ = environment.reset(seed=seed)
        return policy.demand(Belief.from_observation(observation)).layers[0][0]

    draws = [draw(policy, seed) for seed in range(4)]
    assert np.array_equal(draw(policy, 0), draws[0])
    pairs = [
        common(ours, theirs) for ours, theirs in itertools.combinations([*draws, draw(other, 0)], 2)
    ]
    assert max(pairs) < share + 0.05


def test_random_points_do_not_hang_on_the_last_bits_of_the_cloud(environment):
    policy = care_sim.make_policy("random-points", environment)
    cells = np.arange(0, 900, 3)
    points = np.random.default_rng(0).uniform(1, 50, (300, 3))
    assert (
        policy.kept(cells, points, 20) == policy.kept(cells, np.nextafter(points, 99), 20)
    ).all()
    assert (policy.kept(cells, points, 20) != policy.kept(cells, points + 0.001, 20)).any()


@pytest.mark.usefixtures("open3d")
def test_farthest_points_are_those_of_the_plain_algorithm(environment):
    grid = environment.unwrapped.rig.grid
    rng = np.random.default_rng(0)
    cells = np.sort(rng.choice(grid.size, 300, replace=False))
    points = grid.directions[cells] * rng.uniform(2, 50, (300, 1))
    policy = FarthestPoints(environment.unwrapped.rig, truth=None)
    chosen = [0]
    distance = np.linalg.norm(points - points[0], axis=1)
    for _ in range(39):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    assert set(policy.kept(cells, points, 40).tolist()) == set(cells[chosen].tolist())
    assert policy.kept(cells[:0], points[:0], 0).tolist() == []


def test_without_open3d_farthest_points_names_the_extra(environment, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(
        MissingExtra, match=r"extra 'open3d': pip install -c constraints.txt -e '\.\[open3d\]'"
    ):
        care_sim.make_policy("farthest-points", environment)


def test_an_environment_without_truth_is_refused(environment):
    class Blindfold(gymnasium.Wrapper):
        def get_wrapper_attr(self, name):
            if name == "truth":
                raise AttributeError(name)
            return super().get_wrapper_attr(name)

    with pytest.raises(
        InvalidInput, match="history-oracle needs an environment of CARE-Sim with a truth"
    ):
        care_sim.make_policy("history-oracle", Blindfold(environment))
