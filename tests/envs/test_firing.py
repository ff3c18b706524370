"""Rules that every hardware keeps in every loop, whoever plays."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.firing.listing import HARDWARE

LOOPS = ("CARE-Dense-v0", "CARE-Street-v0")
POLICIES = ("care", "care-units", "random", "fan", "place")
FIRINGS = (*HARDWARE, "tiles:2x16", "azimuth-window:0")


@pytest.fixture(scope="module", params=LOOPS)
def loop(request, short_streets):
    return request.param


def played(env, policy, keyframes=3):
    """The fired cells of the first keyframes."""
    observation, _ = env.reset(seed=0)
    policy.reset()
    for _ in range(keyframes):
        action = policy(observation)
        asked = env.unwrapped.would_fire(action)
        observation, *_, info = env.step(action)
        assert np.array_equal(asked, info["fired"])
        yield observation, np.array(info["fired"])


@pytest.mark.parametrize("firing", FIRINGS)
def test_every_policy_fires_whole_units_of_the_budget(loop, firing):
    with gymnasium.make(loop, budget=0.05, firing=firing) as env:
        rig = env.unwrapped.rig
        hardware = rig.hardware
        assert abs(rig.budget / rig.grid.size - 0.05) <= 0.5 / hardware.units
        for name in POLICIES:
            policy = care_sim.make_policy(name, env)
            for observation, fired in played(env, policy):
                assert len(fired) == rig.budget
                cells, shots = np.unique(fired, return_counts=True)
                assert shots.max() <= hardware.most_shots
                sizes = np.bincount(hardware.unit_of[cells])
                assert {*sizes.tolist()} <= {0, hardware.unit_cells}
                # Fired cells have a range or reached nothing; all others were not fired.
                assert np.array_equal(np.flatnonzero(observation["ranges"].ravel()), cells)


def test_without_a_floor_units_stay_unspent_and_windows_do_not(loop):
    with gymnasium.make(loop, budget=0.05, firing="tiles", floor=False) as env:
        policy = care_sim.make_policy("random", env)
        assert [len(fired) for _, fired in played(env, policy)] == [0, 0, 0]
    with gymnasium.make(loop, budget=0.05, firing="azimuth-window", floor=False) as env:
        policy = care_sim.make_policy("random", env)
        budget = env.unwrapped.rig.budget
        assert [len(fired) for _, fired in played(env, policy)] == [budget] * 3


def test_a_window_turns_by_what_it_may_from_keyframe_to_keyframe(loop):
    """Ten degrees are fourteen columns; the farther to the left, the more a cell is wanted."""
    with gymnasium.make(loop, budget=0.05, firing="azimuth-window:10") as env:
        env.reset(seed=0)
        action = np.zeros(env.action_space.shape, np.float32)
        action[:, 256:384] = np.linspace(0.1, 1, 128)
        edges = [256 - 13]
        for _ in range(3):
            *_, info = env.step(action)
            edges.append(np.unique(np.array(info["fired"]) % 512).min())
    assert np.diff(edges).tolist() == [14, 14, 14]


def test_another_hardware_is_refused_in_one_line(loop):
    for firing, told in (
        ("magic", "unknown firing 'magic'; known: cells, tiles:ROWSxCOLUMNS"),
        ("tiles:3x8", "rows of firing tiles must divide the 32 of the grid, got 3"),
    ):
        with pytest.raises(InvalidInput, match=told):
            gymnasium.make(loop, firing=firing)
    with pytest.raises(InvalidInput, match=r"budget 0\.01 leaves no row of 32"):
        gymnasium.make(loop, firing="rows", budget=0.01)
