"""Episodes that differ: what a seed draws, that it is played, and the reward that all share."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import TRAINING, VALIDATION, split_of
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import SensorSetup
from care_sim.envs import make_env
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.sensing import sensing
from care_sim.training.config import PpoConfig, SacConfig
from care_sim.training.drawn import STREETS, Mirrored, MissedChances, drawn
from care_sim.training.environments import plain, training, validation_episodes, wrapped
from care_sim.wrappers import GridObservation, SectorReserve
from tests.helpers.handmade_film import BEHIND, BESIDE, ENTRY, WALKER, handmade_film, returns_of

BUDGETS = (0.01, 0.03, 0.1)
TOLD = {"env_parameters": ("scoring_info=True", "CARE-NCAP-v0.test=drawn",
                           "CARE-NCAP-v0.speed_kph=0")}  # fmt: skip
CONFIG = PpoConfig(drawn=True, env=("CARE-Dense-v0", "CARE-NCAP-v0"), budget=BUDGETS, **TOLD)


@given(seed=st.integers(0, 2**31 - 2))
def test_a_seed_draws_one_episode_of_its_own_split(seed):
    draw = drawn(seed, 3, BUDGETS)
    assert draw == drawn(seed, 3, BUDGETS)
    assert draw.seed == seed
    assert split_of([seed, draw.street]) == split_of([seed])
    without = drawn(seed, 3, BUDGETS, faulty=False)
    assert without == drawn(seed, 3, BUDGETS, faulty=False)
    assert without.faults == {}
    assert vars(without) | {"faults": draw.faults} == vars(draw)


def test_all_there_is_is_drawn_and_as_often_as_the_page_says():
    draws = [drawn(seed, 3, BUDGETS) for seed in range(TRAINING, TRAINING + 3000)]
    for values, count in (
        ([draw.place for draw in draws], 3),
        ([draw.budget for draw in draws], 3),
        ([draw.mirrored for draw in draws], 2),
        ([draw.street for draw in draws], STREETS),
    ):
        shares = np.unique(values, return_counts=True)[1] / len(draws)
        np.testing.assert_allclose(shares, 1 / count, atol=0.04)
    faults = [draw.faults for draw in draws]
    for expected, there in (
        (0.40, [not fault for fault in faults]),
        (0.15, [fault == {"false_negative_rate": 1.0} for fault in faults]),
        (0.20, ["camera_latency" in fault for fault in faults]),
        (0.25, ["false_negative_burst" in fault for fault in faults]),
    ):
        assert np.mean(there) == pytest.approx(expected, abs=0.03)


def test_an_episode_is_that_of_the_environment_which_was_drawn():
    """World, budget, faults and floor, to the last bit."""
    env = plain(CONFIG)
    met = set()
    for seed in range(TRAINING, TRAINING + 4):
        draw = drawn(seed, 2, BUDGETS)
        name = CONFIG.env[draw.place]
        own = make_env(name, budget=draw.budget, **CONFIG.arguments(name), **draw.faults)
        np.testing.assert_equal(env.reset(seed=seed)[0], own.reset(seed=seed)[0])
        for n in range(3):
            action = np.random.default_rng(n).random(own.action_space.shape, np.float32)
            np.testing.assert_equal(env.step(action)[0], own.step(action)[0])
        assert env.rig == own.unwrapped.rig
        met.add(name)
        own.close()
    env.close()
    assert met == set(CONFIG.env)


def test_who_learns_without_faults_is_validated_with_them():
    config = replace(CONFIG, env=("CARE-Dense-v0",), without=("faults",), env_parameters=())
    learns, shown = training(config), wrapped(config)
    faulty = {seed for seed in range(VALIDATION, VALIDATION + 6) if drawn(seed, 1, BUDGETS).faults}
    assert faulty
    for seed in range(VALIDATION, VALIDATION + 6):
        learns.env.reset(seed=seed)
        shown.reset(seed=seed)
        usual = sensing(make_env("CARE-Dense-v0")).conditions
        assert sensing(learns.env).conditions == usual
        assert (sensing(shown).conditions != usual) == (seed in faulty)
    learns.close()
    shown.close()


def test_every_reset_draws_another_episode_and_a_budget_of_ones_own_changes_no_other_part():
    """`full` plays what the others play."""
    with plain(CONFIG) as env, plain(CONFIG, 1.0) as whole, training(CONFIG) as learns:
        told = [one.reset(seed=VALIDATION)[1] for one in (env, whole)]
        np.testing.assert_equal(*told)
        assert env.unwrapped.conditions == whole.unwrapped.conditions
        assert whole.rig.budget == 16_384
        first, second = (env.reset()[1]["seed"] for _ in range(2))
        env.reset(seed=VALIDATION)
        assert env.reset()[1]["seed"] == first != second
        assert learns.reset(seed=0)[1]["seed"] >= TRAINING
    assert min(validation_episodes(CONFIG)) >= VALIDATION
    assert set(validation_episodes(CONFIG).values()) == set(CONFIG.env)


def test_an_environment_named_twice_is_drawn_twice_as_often():
    config = PpoConfig(drawn=True, env=("CARE-Dense-v0", *("CARE-CutIn-v0",) * 2), episodes=600)
    names = [*validation_episodes(config).values()]
    assert names.count("CARE-CutIn-v0") / len(names) == pytest.approx(2 / 3, abs=0.05)


def pictured(**arguments):
    return GridObservation(SectorReserve(make_env("CARE-Dense-v0", **arguments)))


def test_a_mirrored_picture_is_that_of_the_mirrored_world():
    """The scenario reflects its world itself; what the camera shows of it is reflected alike."""
    world, picture = pictured(mirrored="always"), Mirrored(pictured(), (6, 8, 64))
    told = (("residual", 1, False), ("explained", 2, True))
    seen = [env.reset(seed=3)[0] for env in (world, picture)]
    for _ in range(12):
        # Hulls and wedges; what fires at random beside them is not reflected.
        scores = np.zeros((4, 32), np.float32)
        seen = [env.step(scores)[0] for env in (world, picture)]
    for name, channel, wanted in told:
        one, other = (each["grid"].reshape(6, 8, 64)[channel] for each in seen)
        # Pixels are not quite symmetric about the middle of a picture.
        np.testing.assert_allclose(one, other, atol=0.25, err_msg=name)
        assert not wanted or one.any()
        assert not np.array_equal(one, one[:, ::-1]) or not wanted
    np.testing.assert_allclose(seen[0]["ego"], seen[1]["ego"], atol=1e-6)
    world.close()
    picture.close()


def test_a_sector_scored_in_a_mirrored_episode_fires_on_the_other_side():
    env = Mirrored(pictured(budget=0.01, reserve_fraction=1.0), (6, 8, 64))
    env.reset(seed=0)
    scores = np.zeros((4, 32), np.float32)
    scores[1, 3] = 1.0
    fired = env.step(scores)[-1]["fired"]
    own = pictured(budget=0.01, reserve_fraction=1.0)
    own.reset(seed=0)
    scores[1, 3], scores[1, 28] = 0.0, 1.0
    np.testing.assert_array_equal(fired, own.step(scores)[-1]["fired"])
    env.close()
    own.close()


@pytest.mark.parametrize(
    "setup",
    [
        SensorSetup("turned", AngularGrid(heading=0.3)),
        SensorSetup("tilted", AngularGrid(roll=0.1)),
        SensorSetup("aside", position=(0.0, 0.5, 1.84)),
    ],
)
def test_sides_of_a_sensor_that_are_not_alike_are_not_exchanged(setup):
    with (
        pictured(sensor=setup) as env,
        pytest.raises(InvalidInput, match="sides can be drawn only of a LiDAR that stands in the"),
    ):
        Mirrored(env, (6, 8, 64))


def test_the_running_episode_is_what_an_environment_shows():
    env = wrapped(CONFIG)
    for seed in range(TRAINING, TRAINING + 8):
        seen, _ = env.reset(seed=seed)
        draw = drawn(seed, 2, BUDGETS)
        assert seen in env.observation_space
        assert env.unwrapped.rig.budget == round(draw.budget * 16_384)
        assert isinstance(env._env, Mirrored) == draw.mirrored
        assert sensing(env).conditions.false_negative_rate == draw.faults.get(
            "false_negative_rate", 0
        )
    env.close()


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        (PpoConfig, {"env": ("CARE-Dense-v0", "CARE-CutIn-v0")}, "2 environments need --drawn"),
        (PpoConfig, {"env": ()}, r"env needs one name or more, got \(\)"),
        (PpoConfig, {"drawn": True, "gain": 3.0}, "gain weighs a term of another reward"),
        (PpoConfig, {"without": ("faults",)}, "without faults needs --drawn"),
        (PpoConfig, {"without": ("wheels",)}, "unknown part to be without 'wheels'"),
        (SacConfig, {"without": ("place",)}, "without place needs ppo: sac sees all sectors"),
        (
            PpoConfig,
            {"env_parameters": ("CARE-Moon-v0.gravity=1",)},
            "unknown environment of env_parameter CARE-Moon-v0.gravity",
        ),
    ],
)
def test_what_does_not_fit_is_refused_at_once(kind, options, message):
    with pytest.raises(InvalidInput, match=message):
        kind(**options)


def test_what_is_wrong_with_any_of_the_environments_is_told_before_the_first_episode():
    for wrong in ({"env": ("CARE-Dense-v0", "CARE-Moon-v0")}, {"budget": (0.03, 2.0)}):
        config = PpoConfig(**{"drawn": True, "env": ("CARE-Dense-v0",)} | wrong)
        with pytest.raises(InvalidInput, match=r"Moon|budget"):
            wrapped(config)


def test_environments_with_other_lidars_are_refused():
    """Pictures of both fit one network, but its weights would fit one grid alone."""
    config = replace(CONFIG, env_parameters=("CARE-NCAP-v0.sensor=os1-64",))
    with pytest.raises(InvalidInput, match="only of environments with the same LiDAR"):
        wrapped(config)


def test_a_run_goes_on_with_its_own_recipe_alone():
    assert PpoConfig(env="CARE-CutIn-v0") == PpoConfig(env=("CARE-CutIn-v0",))
    before = PpoConfig(env="CARE-CutIn-v0").recipe
    assert before["env"] == "CARE-CutIn-v0"
    PpoConfig(env="CARE-CutIn-v0", steps=7).check_same(before)
    before = PpoConfig().recipe
    with pytest.raises(InvalidInput, match="trained with drawn False, asked is True"):
        PpoConfig(drawn=True).check_same(before)


def played(env, choose, seed=0):
    """Rewards of an episode."""
    env.reset(seed=seed)
    rewards, over = [], False
    while not over:
        _, reward, terminated, truncated, _ = env.step(choose())
        rewards.append(reward)
        over = terminated or truncated
    env.close()
    return rewards


@pytest.mark.parametrize("name", ["CARE-Dense-v0", "CARE-NCAP-v0", "CARE-Drive-v0"])
def test_the_full_scan_misses_none(name):
    env = MissedChances(make_env(name, budget=1.0))
    seen = np.ones(env.action_space.shape, np.float32)
    # A drive in which somebody comes out.
    assert set(played(env, lambda: seen, seed=10_002)) == {0.0}


def test_who_never_fires_misses_every_keyframe_at_which_a_full_scan_would_detect():
    env = MissedChances(make_env("CARE-Dense-v0", floor=False))
    nothing = np.zeros(env.action_space.shape, np.float32)
    detectable = []

    def choose():
        loop = env.unwrapped.loop
        detectable.append(loop.would_detect(loop.world.first_sighting.body))
        return nothing

    rewards = played(env, choose)
    assert [-reward for reward in rewards] == detectable
    assert 5 < sum(detectable) < len(detectable)


def test_who_was_detected_once_is_no_chance_any_more():
    env = MissedChances(make_env("CARE-Dense-v0", budget=1.0, floor=False))
    shape, keyframes = env.action_space.shape, []

    def choose():
        keyframes.append(len(keyframes))
        return np.full(shape, float(len(keyframes) == 30), np.float32)

    rewards = played(env, choose)
    assert sum(rewards[:29]) < 0
    assert set(rewards[29:]) == {0.0}


def test_of_a_drive_everybody_counts_whom_it_lets_the_ego_meet():
    env = MissedChances(make_env("CARE-Drive-v0", floor=False, encounters=3))
    nothing = np.zeros(env.action_space.shape, np.float32)
    most = []

    def choose():
        loop = env.unwrapped.loop
        most.append(sum(loop.would_detect(one.body) for one in loop.world.meetings))
        return nothing

    rewards = played(env, choose, seed=10_002)
    assert [-reward for reward in rewards] == most
    assert sum(most) > 5


def scores(*numbers, index):
    action = np.zeros((32, 512), np.float32)
    for number in numbers:
        action.ravel()[returns_of(number, index)] = 1.0
    return action


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        # Present at the start: AHEAD. First sightings: the WALKER at keyframe 1, the others at 2.
        ([(), (), ()], [0, -1, -4]),
        ([(), (WALKER,), ()], [0, 0, -3]),
        ([(), (WALKER,), (BESIDE, BEHIND)], [0, 0, -1]),
        ([(), (), (WALKER,)], [0, -1, -3]),
    ],
)
def test_of_a_scene_the_first_sightings_count(found, expected):
    env = MissedChances(FilmEnv(handmade_film(), budget=0.5, floor=False))
    actions = (scores(*numbers, index=index) for index, numbers in enumerate(found))
    assert played(env, lambda: next(actions)) == expected


def test_an_event_counts_until_it_is_censored():
    """The four first sightings cost 1 at each of K = 6 keyframes and nothing after."""
    env = MissedChances(FilmEnv(handmade_film(10), budget=0.5, floor=False))
    nothing = np.zeros((32, 512), np.float32)
    assert played(env, lambda: nothing) == [0, -1, *[-4] * 5, -3, 0, 0]


def test_who_is_out_of_range_or_gone_is_no_chance():
    """The bus is beyond 50 m and two are gone again, at keyframes 2 and 3."""
    film = handmade_film()
    near, far = film.shots[ENTRY], film.shots[1]
    film = replace(film, shots=(film.shots[0], near, far, far))
    env = MissedChances(FilmEnv(film, budget=0.5, floor=False))
    nothing = np.zeros((32, 512), np.float32)
    assert played(env, lambda: nothing) == [0, -4, -1, -1]
