"""What no fired ray touches and no camera sees cannot reach an observation."""

import gymnasium
import numpy as np
import pytest

from care_sim.envs import CLOSED_LOOP
from care_sim.sensors.engines import Bullet, Fast

BEHIND = (-15.0, 1.0, 0.0)


def observe(name, pose, mask, **conditions):
    """Observations over four keyframes with a car put at `pose`, out of view."""
    env = gymnasium.make(name, disable_env_checker=True, floor=False, **conditions).unwrapped
    env.reset(seed=0)
    world = env.loop.world
    # Behind the ego stands a hoarding across the road: a drive has cameras all round.
    world.add("screen", "hoarding", (-8.0, 0.0, np.pi / 2))
    hidden = world.add("hidden car", "car", pose)
    observations = [env.step(mask)[0] for _ in range(4)]
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
@pytest.mark.parametrize(("made", "engine"), [("bullet", Bullet), ("fast", Fast)])
def test_only_fired_cells_are_cast(monkeypatch, name, made, engine):
    env = gymnasium.make(name, disable_env_checker=True, budget=0.05, engine=made).unwrapped
    env.reset(seed=0)
    counts = []
    cast = engine.cast
    monkeypatch.setattr(engine, "cast", lambda *given: counts.append(len(given[2])) or cast(*given))
    for _ in range(3):
        env.step(env.action_space.sample())
    assert counts == [819, 819, 819]
    env.close()


@pytest.mark.parametrize("name", [name for name in CLOSED_LOOP if name != "CARE-Dartout-v0"])
def test_the_observation_holds_no_body_id(name):
    """Tracks are numbered from 0. In the dart-out nobody is there at first."""
    env = gymnasium.make(name, disable_env_checker=True, budget=1.0).unwrapped
    env.reset(seed=0)
    env.step(np.ones((32, 512), bool))
    tracks = env.loop.belief.tracks
    assert len(tracks) > 0
    np.testing.assert_array_equal(np.sort(tracks.ids), np.arange(len(tracks)))
    env.close()
