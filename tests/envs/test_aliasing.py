"""Arguments and results of an environment belong to the caller, who may write into them."""

import gymnasium
import numpy as np
import pytest

from care_sim.wrappers import GridObservation, SectorReserve

KEYFRAMES = 5


@pytest.fixture(params=["CARE-Dense-v0", "CARE-Replay-v0"])
def make(request):
    replay = request.param == "CARE-Replay-v0"
    place = {"source": f"argoverse2:{request.getfixturevalue('drive')}"} if replay else {}
    envs = []

    def made(wrap=lambda env: env, **arguments):
        envs.append(
            wrap(
                gymnasium.make(
                    request.param, disable_env_checker=True, budget=0.03, **place, **arguments
                )
            )
        )
        return envs[-1]

    yield made
    for env in envs:
        env.close()


def scrawl(*given):
    """Write into everything that can be written into."""
    for thing in given:
        if isinstance(thing, np.ndarray):
            thing[...] = 7
        elif isinstance(thing, dict):
            scrawl(*thing.values())
            thing.clear()
        elif isinstance(thing, list):
            thing.clear()


def played(env, touch, inner=lambda _: None):
    """All that is seen and fired; `touch` gets all that changed hands, before each keyframe and
    after it.
    """
    rng = np.random.default_rng(0)
    told = []
    observation, info = env.reset(seed=3)
    for _ in range(KEYFRAMES):
        told.append({key: array.tobytes() for key, array in observation.items()})
        touch(observation, info)
        action = rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        action = np.maximum(action, 0) if env.action_space.low.min() == 0 else action
        observation, _, _, _, info = env.step(action)
        told.append(np.asarray(info["fired"]).tolist())
        touch(action)
        told.append(inner(env.unwrapped))
    return told


def kept(inner):
    records = inner.keyframes
    return (
        [record.fired.tolist() for record in records],
        inner.acted.tobytes(),
        inner.loop.belief.ranges.tobytes(),
    )


@pytest.mark.parametrize("floor", [True, False])
def test_writing_into_what_was_given_changes_nothing_that_is_seen_fired_or_kept(make, floor):
    clean, written = (played(make(floor=floor), touch, kept) for touch in (lambda *_: None, scrawl))
    assert clean == written


@pytest.mark.parametrize("wrap", [SectorReserve, lambda env: GridObservation(SectorReserve(env))])
def test_writing_into_what_wrappers_gave_changes_nothing_that_they_act_on_or_show(make, wrap):
    clean, written = (played(make(wrap), touch) for touch in (lambda *_: None, scrawl))
    assert clean == written


def test_writing_into_an_observation_that_a_wrapper_passed_on_is_too_late_for_it(make):
    seen = []

    def meddling(env):
        def meddle(observation):
            seen.append({key: array.copy() for key, array in observation.items()})
            scrawl(*observation.values())
            return observation

        inner = SectorReserve(env)
        return gymnasium.wrappers.TransformObservation(inner, meddle, env.observation_space)

    def fired(told):
        return [one for one in told if isinstance(one, list)]

    clean = fired(played(make(SectorReserve), lambda *_: None))
    assert fired(played(make(meddling), lambda *_: None)) == clean
    assert len(seen) == KEYFRAMES + 1


def test_an_observation_stays_what_it_was_when_the_episode_goes_on(make):
    env = make()
    observation, _ = env.reset(seed=0)
    before = {key: array.copy() for key, array in observation.items()}
    env.step(np.ones(env.action_space.shape, np.float32))
    for key, array in before.items():
        np.testing.assert_array_equal(observation[key], array)
    assert all(array.flags.writeable for array in observation.values())
