"""What an agent must not know: keys of `info` that tell the truth, and episodes looked up by their
seed.
"""

import re

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.envs import CLOSED_LOOP
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.streets.street import make_street

OWN = {name: {"fired", "braking", "time_s"} for name in CLOSED_LOOP} | {
    "CARE-Replay-v0": {"fired", "time_s"}
}
SHORT = {name: {"duration_s": 0.5} for name in CLOSED_LOOP}
NOTHING = np.zeros((32, 512), np.float32)
SECRET = "6d0f5b7e"


@pytest.fixture
def make(request):
    envs = []

    def made(name, **arguments):
        if name == "CARE-Replay-v0":
            arguments["source"] = f"argoverse2:{request.getfixturevalue('drive')}"
        envs.append(gymnasium.make(name, disable_env_checker=True, **arguments))
        return envs[-1]

    yield made
    for env in envs:
        env.close()


def infos(env):
    told = [env.reset(seed=0)[1]]
    ended = False
    while not ended:
        *_, terminated, truncated, info = env.step(NOTHING)
        told.append(info)
        ended = terminated or truncated
    return told


@pytest.mark.parametrize("name", OWN)
def test_without_scoring_info_only_what_the_car_knows_is_told_and_at_the_end_the_outcome(
    make, name
):
    begun, *steps, last = infos(make(name, scoring_info=False, **SHORT.get(name, {})))
    assert begun == {}
    assert all(set(info) == OWN[name] for info in steps)
    assert set(last) == OWN[name] | {"outcome"}


@pytest.mark.parametrize("name", OWN)
def test_every_key_of_info_stands_on_the_page_as_the_cars_own_or_for_scoring_alone(make, name):
    kind = ClosedLoopEnv if name in CLOSED_LOOP else OpenLoopEnv
    lines = re.findall(
        r"^ *\| (`.*) \| .* \| (the car's own|scoring alone) \|$", kind.__doc__, re.MULTILINE
    )
    page = {
        key: whose
        for keys, whose in lines
        for key in re.findall(r"`(\w+)`", keys.partition(" | ")[0])
    }
    told = {key for info in infos(make(name, **SHORT.get(name, {}))) for key in info}
    # Not every scenario draws parameters, and not every return has strength and an instant.
    sometimes = {"intensities", "times_s"}
    assert told <= set(page) <= told | {"drawn"} | sometimes
    assert {key for key, whose in page.items() if whose == "the car's own"} == OWN[name] | sometimes


def test_the_truth_left_out_changes_nothing_else(make):
    with_it, without = (
        make("CARE-Dense-v0", scoring_info=told, false_negative_rate=1.0) for told in (True, False)
    )
    np.testing.assert_equal(with_it.reset(seed=1)[0], without.reset(seed=1)[0])
    for _ in range(3):
        (*answer, info), (*other, less) = with_it.step(NOTHING), without.step(NOTHING)
        np.testing.assert_equal(answer, other)
        np.testing.assert_equal({key: info[key] for key in less}, less)


def begins(env, seed):
    """The first observation, and after two scans of every cell; then the place of everybody at
    three moments.
    """
    observation, _ = env.reset(seed=seed)
    seen = [observation, *(env.step(np.ones((32, 512), np.float32))[0] for _ in range(2))]
    world = env.unwrapped.loop.world
    return seen, [actor.pose_at(time) for actor in world.actors for time in (0.0, 3.5, 4.0)]


def same(one, other):
    return all(np.array_equal(one[key], other[key]) for key in one)


@pytest.mark.parametrize("name", CLOSED_LOOP)
def test_a_secret_makes_another_episode_of_a_seed_and_the_same_one_again(make, name):
    public, secret, again, other = (
        begins(make(name, budget=1.0, secret=text), 0)
        for text in (False, SECRET, SECRET, SECRET[::-1])
    )
    assert all(map(same, secret[0], again[0]))
    assert secret[1] == again[1]
    for different in (public, other):
        assert not any(map(same, secret[0], different[0]))
        assert secret[1] != different[1]


def test_a_secret_enters_misses_floor_and_losses_of_a_recorded_scene(make):
    faults = {"budget": 0.2, "false_negative_rate": 0.5, "lidar_dropout": 0.5}
    public, secret, again = (
        make("CARE-Replay-v0", **faults, secret=text) for text in (False, SECRET, SECRET)
    )
    fired = []
    for env in (public, secret, again):
        env.reset(seed=0)
        told = [env.step(NOTHING) for _ in range(3)]
        fired.append(
            (
                [info["fired"].tolist() for *_, info in told],
                [observation["detections"].tolist() for observation, *_ in told],
                [observation["ranges"].tolist() for observation, *_ in told],
            )
        )
    assert fired[1] == fired[2]
    assert all(one != other for one, other in zip(fired[0], fired[1], strict=True))


def test_a_secret_makes_another_street_whose_name_does_not_tell_its_seed(make):
    env = make("CARE-Street-v0", secret=SECRET)
    _, info = env.reset(seed=7)
    film = env.unwrapped.loop.film
    assert len(film.shots) == 40
    assert film.name == info["scene"] == "street-0007-secret"
    assert {shot.token.partition("/")[0] for shot in film.shots} == {film.name}
    ways = [[(shot.sensor.x, shot.sensor.y) for shot in film.shots], make_street(7).ego[:, :2]]
    assert not np.allclose(*ways, atol=2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scoring_info": ["x" * 9999]}, "scoring_info must be True or False, got .{,130}$"),
        ({"secret": None}, "secret must be a text"),
        ({"secret": ""}, "secret must not be empty"),
        ({"scoring_info": 1}, "scoring_info must be True or False, got 1"),
    ],
)
@pytest.mark.parametrize("name", ["CARE-Dense-v0", "CARE-Street-v0"])
def test_another_value_is_refused_in_one_line(name, arguments, message):
    with pytest.raises(InvalidInput, match=message):
        gymnasium.make(name, disable_env_checker=True, **arguments)
