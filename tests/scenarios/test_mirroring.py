"""Worlds reflected at the ego's lane."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.rig import Rig
from care_sim.policies.controls.rehearsed import rehearsal
from care_sim.scenarios import SCENARIOS, make_scenario
from care_sim.scenarios.base import MirrorableScenario, MirroredWorld

every_scenario = pytest.mark.parametrize(
    "name", [name for name, kind in SCENARIOS.items() if issubclass(kind, MirrorableScenario)]
)


def boxes(name, mirrored, seed=0, seconds=4.0):
    """(keyframes, n, 7) every body and the ego, once a keyframe, while the ego brakes a little."""
    world = make_scenario(name, mirrored=mirrored).build(np.random.default_rng(seed))
    seen = []
    for _ in range(round(seconds / 0.1)):
        seen.append(
            np.vstack([world.boxes(world.actors), world.boxes_of(np.array([world.ego_body]))])
        )
        world.advance(-1.0, 0.1)
    world.close()
    return np.array(seen)


@every_scenario
def test_every_body_stands_and_moves_on_the_other_side(name):
    here, there = boxes(name, "never"), boxes(name, "always")
    reflected = here * [1, -1, 1, 1, 1, 1, -1]
    assert np.ptp(here[:, :-1, 1], axis=0).max() > 0.2  # the actor crosses or pulls out
    np.testing.assert_allclose(there, reflected, atol=1e-9)


def test_a_full_scan_of_the_reflection_is_the_reflection_of_the_scan():
    scans = []
    for mirrored in ("never", "always"):
        loop = rehearsal(make_scenario("dense", mirrored=mirrored), 3, Rig())
        scans.append(loop.full_scan().ranges.reshape(Rig().grid.shape))
        loop.world.close()
    assert np.isfinite(scans[0]).mean() > 0.3
    np.testing.assert_allclose(scans[1], scans[0][:, ::-1], rtol=1e-4)


@every_scenario
def test_a_drawn_side_is_one_of_both_and_each_comes(name):
    sides = []
    for seed in range(8):
        drawn, here, there = (boxes(name, m, seed, 0.1) for m in ("drawn", "never", "always"))
        assert np.array_equal(drawn, here) != np.array_equal(drawn, there)
        sides.append(np.array_equal(drawn, there))
    assert {*sides} == {True, False}


@every_scenario
def test_the_side_that_was_drawn_is_told(name):
    for seed in range(6):
        world = make_scenario(name, mirrored="drawn").build(np.random.default_rng(seed))
        told = {"mirrored": "always" if isinstance(world, MirroredWorld) else "never"}
        assert world.drawn == told
        world.close()
    world = make_scenario(name, mirrored="always").build(np.random.default_rng(0))
    assert world.drawn == {}
    world.close()


@every_scenario
def test_another_word_is_refused(name):
    with pytest.raises(
        InvalidInput, match=f"mirrored of {name} 'half'; known: always, drawn, never"
    ):
        make_scenario(name, mirrored="half")
