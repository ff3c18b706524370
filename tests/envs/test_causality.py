"""An observation shows nothing that no fired ray touches and no camera sees."""

import gymnasium
import numpy as np
import pytest

from care_sim.envs import CLOSED_LOOP
from care_sim.loops.stages import scanning
from care_sim.scenarios.base import Scenario
from care_sim.sensors.engines import Bullet

BEHIND = (-15.0, 1.0, 0.0)


def observe(name, pose, mask, **conditions):
    """Observations over four keyframes with a car put at `pose`, out of view."""
    env = gymnasium.make(name, disable_env_checker=True, floor=False, **conditions).unwrapped
    made = Scenario.make_world

    def with_two_more(scenario, rng):
        world = made(scenario, rng)
        # Behind the ego stands a hoarding across the road: a drive has cameras all round.
        world.add("screen", "hoarding", (-8.0, 0.0, np.pi / 2))
        world.add("hidden car", "car", pose)
        return world

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scenario, "make_world", with_two_more)
        env.reset(seed=0)
    observations = [env.step(mask)[0] for _ in range(4)]
    world = env.loop.world
    hidden = world.actors[-1]
    _, hits = world.bullet.cast(
        env.loop.sensor.origin, env.rig.grid.directions[np.flatnonzero(mask)], 50.0
    )
    env.close()
    return observations, bool(np.any(hits == hidden.body))


def forward_mask():
    mask = np.zeros((32, 512), bool)
    mask[:, 192:320] = True
    return mask


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_moving_what_nobody_looks_at_changes_nothing(name):
    (near, touched), (far, _) = (
        observe(name, BEHIND, forward_mask()),
        observe(name, (-30.0, -1.0, 0.5), forward_mask()),
    )
    assert not touched
    for before, after in zip(near, far, strict=True):
        for key in before:
            np.testing.assert_array_equal(before[key], after[key])


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_moving_what_a_fired_ray_touches_changes_the_scan(name):
    backward = np.zeros((32, 512), bool)
    backward[:, :64] = backward[:, -64:] = True
    before_the_screen = (-6.0, 0.0, 0.0)
    (near, touched), (far, _) = (
        observe(name, pose, backward) for pose in (before_the_screen, BEHIND)
    )
    assert touched
    assert not np.array_equal(near[0]["ranges"], far[0]["ranges"])


@pytest.mark.parametrize("name", CLOSED_LOOP)
@pytest.mark.parametrize("engine", ["bullet", "fast"])
def test_only_fired_cells_are_cast(monkeypatch, name, engine):
    env = gymnasium.make(name, disable_env_checker=True, budget=0.05, engine=engine).unwrapped
    env.reset(seed=0)
    counts = []
    cast, scan = Bullet.cast, scanning._scan
    monkeypatch.setattr(Bullet, "cast", lambda *its: counts.append(len(its[2])) or cast(*its))
    monkeypatch.setattr(
        scanning, "_scan", lambda *its: counts.extend(its[1].counts.tolist()) or scan(*its)
    )
    for _ in range(3):
        env.step(env.action_space.sample())
    assert counts == [819, 819, 819]
    env.close()
