"""Rules that every policy keeps, until after the hidden actor appears: each on one environment in
turn, and every environment with four policies.
"""

from dataclasses import replace
from itertools import chain, product

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.certify.design import AS_LISTED
from care_sim.core.allocation import allocate
from care_sim.core.belief import MAX_DETECTIONS, Belief
from care_sim.core.defaults import CELL_ORDERS
from care_sim.core.residual import camera_layers
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.envs import IDS
from care_sim.policies import BUILT_IN, is_pattern, tags_of

BEFORE = {
    "CARE-Dartout-v0": 24,
    "CARE-Dense-v0": 24,
    "CARE-CutIn-v0": 24,
    "CARE-NCAP-v0": 20,
    "CARE-R157-v0": 2,
    "CARE-Street-v0": 2,
    "CARE-Replay-v0": 2,
    "CARE-Drive-v0": 2,
}
"""Keyframes until the hidden one is about to come into view; on the street many are, on the log one
is, and before a cut-in nobody is hidden.
"""
FOUR = ("care", "care-sbf", "care-sightlines", "history-uniform")
CASES = dict.fromkeys([*product(BEFORE, FOUR), *zip([*BEFORE] * 5, BUILT_IN, strict=False)])
KEYFRAMES = 6
OWN = {"care-spread": 1, "care-sightlines": 2, "care-sector": 2}
"""The policies of our own, and the layer of each in which its hulls come first."""
CORE_FIRST = (*OWN, "boxes", "place-hulls", "care-units", "learned-sets")
"""The policies that list their sets with the core first."""
AIMED = ("care-aimed",)
"""The policies with an order of their own (`tests/policies/own/test_care_aimed.py`)."""
SEEING = [
    name
    for name in BUILT_IN
    if name != "full" and not {"privileged", "non-causal", "generator"} & {*tags_of(name)}
]


def test_these_are_all_environments_and_policies():
    assert {*BEFORE} == {*IDS}
    assert {name for _, name in CASES} == {*BUILT_IN}


def read_only(observation):
    for array in observation.values():
        array.flags.writeable = False
    return observation


def driven_to_the_encounter(env):
    """The observation there, the floor having fired until then; with a full scan, which is slow, an
    earlier one.
    """
    observation, _ = env.reset(seed=0)
    for _ in range(BEFORE[env.spec.id] if observation["budget"] < 1 else 2):
        observation, *_ = env.step(np.zeros(env.action_space.shape, np.float32))
    return read_only(observation)


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def case(request, short_streets):
    """An environment, and the name of the policy for it."""
    environment, name = request.param
    if name == "farthest-points":
        request.getfixturevalue("open3d")
    given = {}
    if environment == "CARE-Replay-v0":
        given["source"] = f"argoverse2:{request.getfixturevalue('drive')}"
    elif environment == "CARE-Drive-v0":
        given["duration_s"] = 12.0
    env = gymnasium.make(environment, budget=1.0 if name == "full" else 0.05, **given)
    yield env, name
    env.close()


def test_it_keeps_to_the_budget_repeats_itself_and_shares_nothing(case):
    """A second one of its kind is always shown something else in between; the first plays the
    episode again after a reset.
    """
    env, name = case
    # Policies that play whole episodes first are content with few.
    one, disturbing, other = (
        care_sim.make_policy(name, env, **AS_LISTED.get(name, {})) for _ in range(3)
    )
    first = observation = driven_to_the_encounter(env)
    budget, played = env.unwrapped.rig.budget, []
    for _ in range(KEYFRAMES):
        action = one(observation)
        disturbing(first)
        assert np.array_equal(other(observation), action)
        following, *_, info = env.step(action)
        assert env.action_space.contains(action)
        assert np.isfinite(action).all()
        asked, fired = np.flatnonzero(action).tolist(), info["fired"].tolist()
        assert len(asked) <= budget
        assert len(fired) == len({*fired}) == budget
        assert {*asked} <= {*fired}
        played.append((observation, action))
        observation = read_only(following)
    one.reset()
    if "non-causal" not in tags_of(name) and "privileged" not in tags_of(name):
        assert all(np.array_equal(one(seen), action) for seen, action in played)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("care", {}),
        ("care-sbf", {"k_safe": 0.0, "decay_per_keyframe": 0.25}),
        ("care-sightlines", {}),
        ("care-units", {}),
        ("care-aimed", {}),
        ("sweep", {}),
        ("seed-finder", {}),
    ],
)
def test_asking_again_changes_nothing(name, parameters, encounter, environment):
    """Neither the answer at this keyframe nor those at the coming ones; an action is the allocation
    of the demand.
    """
    asked, asked_again = (care_sim.make_policy(name, environment, **parameters) for _ in range(2))
    for observation in encounter:
        action = asked(observation)
        assert np.array_equal(asked_again(observation), action)
        belief = asked_again.rig.read(observation)
        for _ in range(2):
            demand = asked_again.demand(belief)
            cells = allocate(demand, belief.budget, asked_again.rig.reserve_fraction)
            assert sorted(cells.tolist()) == np.flatnonzero(action).tolist()


@pytest.mark.parametrize("name", [name for name in SEEING if name not in (*CORE_FIRST, *AIMED)])
def test_a_policy_lists_its_sets_row_by_row_from_the_top(name, encounter, environment):
    """As the paper has it: in ascending index. So naming that order changes no action; nor does any
    order that of a pattern.
    """
    policy, named = (
        care_sim.make_policy(name, environment, **AS_LISTED.get(name, {})) for _ in range(2)
    )
    named.rig = replace(named.rig, cell_order="random" if is_pattern(name) else "rows-down")
    for observation in encounter[::6]:
        assert np.array_equal(named(observation), policy(observation))


@pytest.mark.parametrize(("name", "hull_layer"), OWN.items())
def test_a_policy_of_our_own_begins_with_the_core_of_a_set(
    name, hull_layer, encounter, environment
):
    """The core is what the box covers, without the rig's margins; wedges are its first layer."""
    policy = care_sim.make_policy(name, environment)
    bare = replace(policy.rig, azimuth_margin=0, elevation_margin=0)
    checked = [0, 0]
    for observation in encounter:
        belief = policy.rig.read(observation)
        layers = policy.demand(belief).layers
        cores = camera_layers(belief, bare)[0], bare.hulls(belief.tracks.boxes)
        for kind, asked in enumerate((layers[0], layers[hull_layer])):
            for cells, core in zip(asked, cores[kind], strict=True):
                assert set(cells[: len(core)]) <= {*core}
                checked[kind] += 1
    assert min(checked) > 0


@pytest.mark.parametrize("order", CELL_ORDERS[2:])
def test_another_order_fires_other_cells_of_the_same_sets(order, encounter, environment):
    policy, other = (care_sim.make_policy("care", environment) for _ in range(2))
    other.rig = replace(other.rig, cell_order=order)
    differing = 0
    for observation in encounter:
        differing += not np.array_equal(policy(observation) > 0, other(observation) > 0)
        for ours, theirs in zip(
            [*policy.demanded.exploitation, *chain(*policy.demanded.layers)],
            [*other.demanded.exploitation, *chain(*other.demanded.layers)],
            strict=True,
        ):
            assert np.array_equal(np.sort(theirs), ours)
    assert differing


@pytest.mark.parametrize("name", ["care", "care-priority", "all-camera"])
def test_with_a_black_camera_camera_policies_allocate_as_history_cell_for_cell(
    name, encounter, environment
):
    padding = np.zeros((MAX_DETECTIONS, len(ImageDetections.COLUMNS)), np.float32)
    padding[:, 0] = -1
    chooses, history = (care_sim.make_policy(policy, environment) for policy in (name, "history"))
    for observation in encounter:
        blind = {**observation, "detections": padding}
        assert np.array_equal(chooses(blind), history(blind))
        assert np.array_equal(history(observation), history(blind))
    assert any(not np.array_equal(chooses(o), history(o)) for o in encounter)


def haunted(observation):
    """The same with three people more in the picture, none of whom is there."""
    ghosts = np.array([[40, 90, 52, 120], [210, 80, 222, 118], [280, 70, 300, 130]])
    rows = observation["detections"].copy()
    free = np.flatnonzero(rows[:, 0] < 0)[:3]
    rows[free] = 0
    rows[free, 0] = CLASSES.index("pedestrian")
    rows[free, 1] = 0.9
    rows[free, 2:6] = ghosts
    return {**observation, "detections": rows}


@pytest.mark.parametrize("name", SEEING)
def test_false_positives_leave_the_exploitation_cells_as_they_are(name, encounter, environment):
    """And they do reach the reserve of a policy with a camera."""
    rig, chosen = environment.unwrapped.rig, [[], []]
    policies = [
        care_sim.make_policy(name, environment, **AS_LISTED.get(name, {})) for _ in range(2)
    ]
    differing = 0
    for observation in encounter[::4]:
        shown = haunted(observation), observation
        for cells, policy, seen in zip(chosen, policies, shown, strict=True):
            demand = policy.demand(Belief.from_observation(seen))
            taken = allocate(care_sim.Demand(demand.exploitation), rig.budget, rig.reserve_fraction)
            cells.append(taken.tolist())
        differing += not np.array_equal(*(p(seen) for p, seen in zip(policies, shown, strict=True)))
    assert chosen[0] == chosen[1]
    assert differing or name not in ("care", "care-priority", "care-sbf", "all-camera")
