"""Promises of a vector environment besides the episodes."""

import copy
import gc
import multiprocessing
import signal
import threading
import time

import gymnasium
import numpy as np
import pytest

from care_sim import InvalidInput
from tests.helpers.vectors import difference, native, singles

NAME = "CARE-Dartout-v0"


@pytest.fixture
def vector():
    env = native(NAME, 3, threads=2, budget=0.03)
    yield env
    env.close()


def zeros(env):
    return np.zeros(env.action_space.shape, np.float32)


def test_it_is_what_gymnasium_makes_unless_it_is_asked_otherwise():
    env = gymnasium.make_vec(f"care_sim:{NAME}", num_envs=2)
    assert type(env).__name__ == "DartoutVectorEnv"
    assert env.observation_space.contains(env.reset(seed=0)[0])
    env.close()


def test_observations_that_were_handed_out_stay(vector):
    first, _ = vector.reset(seed=0)
    kept = {name: rows.copy() for name, rows in first.items()}
    vector.step(zeros(vector))
    assert all(np.array_equal(first[name], kept[name]) for name in kept)


@pytest.mark.parametrize("threads", [1, 2])
def test_infos_that_were_handed_out_stay(threads):
    env = native(NAME, 2, threads=threads, copy=False)
    env.reset(seed=0)
    first = env.step(zeros(env))[4]
    kept = copy.deepcopy(first)
    env.step(np.random.default_rng(0).random(env.action_space.shape, np.float32))
    assert difference(first, kept) is None
    env.close()


def test_seeds_count_up_or_are_told_one_by_one(vector):
    counted, _ = vector.reset(seed=5)
    told, infos = vector.reset(seed=[5, 6, 7])
    assert infos["seed"].tolist() == [5, 6, 7]
    assert all(np.array_equal(counted[name], told[name]) for name in told)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"num_envs": 0}, "num_envs"),
        ({"threads": 0}, "threads"),
        ({"autoreset_mode": "Sometimes"}, "NextStep, SameStep, Disabled"),
        ({"copy": 1}, "copy"),
        ({"render_mode": "rgb_array"}, 'vectorization_mode="sync"'),
        ({"max_episode_steps": 2.5}, "max_episode_steps"),
        ({"vehicels": 2}, "vehicels"),
        ({"budget": [0.1, 0.2, 0.3]}, "budget must be one value, or .* each of 2 worlds, got"),
        ({"budget": [0.1, 2.0]}, r"budget must lie in \(0, 1\]"),
        ({"camera_latency": [1, True]}, "camera_latency must"),
        ({"reserve_fraction": [0.1, 0.2]}, "reserve_fraction takes one value for all worlds"),
    ],
)
def test_wrong_arguments_are_named(wrong, message):
    arguments = {"num_envs": 2} | wrong
    with pytest.raises(InvalidInput, match=message):
        native(NAME, arguments.pop("num_envs"), **arguments)


def test_wrong_seeds_and_masks_are_named(vector):
    with pytest.raises(InvalidInput, match="one for each of 3"):
        vector.reset(seed=[1, 2])
    for wrong in (-1, np.array(4)):
        with pytest.raises(InvalidInput, match="seed"):
            vector.reset(seed=wrong)
    with pytest.raises(InvalidInput, match="reset_mask"):
        vector.reset(options={"reset_mask": np.zeros(3, bool)})
    with pytest.raises(InvalidInput, match="no options but reset_mask"):
        vector.reset(options={"slow": True})


def test_wrong_actions_are_named_and_nothing_moves(vector):
    with pytest.raises(gymnasium.error.ResetNeeded):
        vector.step(zeros(vector))
    vector.reset(seed=0)
    with pytest.raises(InvalidInput, match="shape"):
        vector.step(zeros(vector)[:2])
    broken = zeros(vector)
    broken[1, 0, 0] = np.nan
    with pytest.raises(InvalidInput, match="NaN"):
        vector.step(broken)
    assert vector.step(zeros(vector))[4]["time_s"].tolist() == [0.0, 0.0, 0.0]


def test_what_differs_is_told_of_each_world():
    budgets = np.array([0.1, 0.03, 0.1])
    env = native(NAME, 3, budget=budgets, camera_latency=(0, 0, 2))
    rigs = env.get_attr("rig")
    assert [rig.budget for rig in rigs] == [1638, 492, 1638]
    assert [each.camera_latency for each in env.get_attr("conditions")] == [0, 0, 2]
    for name in ("rig", "conditions"):
        with pytest.raises(InvalidInput, match=f"must have one {name}"):
            getattr(env, name)
    env.reset(seed=0)
    fired = env.step(zeros(env))[4]["fired"]
    assert [len(cells) for cells in fired] == [1638, 492, 1638]
    env.close()


def test_what_is_over_waits_for_a_reset_where_that_is_asked_for():
    env = native(NAME, 2, autoreset_mode="Disabled", duration_s=0.1)
    env.reset(seed=0)
    assert env.step(zeros(env))[3].all()
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset_mask"):
        env.step(zeros(env))
    env.reset(options={"reset_mask": np.array([True, True])})
    env.step(zeros(env))
    env.close()


def test_threads_end_with_the_environment():
    before = threading.active_count()
    env = native(NAME, 4, threads=4)
    env.reset(seed=0)
    env.step(zeros(env))
    assert threading.active_count() > before
    env.close()
    assert threading.active_count() == before
    env = native(NAME, 4, threads=4)
    env.reset(seed=0)
    env.step(zeros(env))
    del env
    gc.collect()
    wait_for(lambda: threading.active_count() == before)


def test_a_fork_plays_on(vector):
    def played():
        vector.reset(seed=0)
        vector.step(zeros(vector))
        return vector.step(zeros(vector))[0]["tracks"].tobytes()

    here = played()
    processes = multiprocessing.get_context("fork")
    mine, theirs = processes.Pipe()
    process = processes.Process(target=lambda: theirs.send(played()))
    process.start()
    assert mine.poll(60)
    assert mine.recv() == here
    process.join()


def wait_for(holds, seconds=5.0):
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.01)
    assert holds()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_one_world_plays_while_the_other_rests(mode):
    # World 1 is over while world 0, whose episode began later, goes on.
    arguments = {"budget": 0.03, "duration_s": 0.3}
    env = native(NAME, 2, threads=2, autoreset_mode=mode, **arguments)
    reference = singles(NAME, 2, mode, **arguments)
    for one in (env, reference):
        one.reset(seed=0)
        one.step(zeros(one))
        one.reset(seed=[5, None], options={"reset_mask": np.array([True, False])})
    for step in range(12):
        given, expected = env.step(zeros(env)), reference.step(zeros(env))
        alike = dict(enumerate(given)), dict(enumerate(expected))
        assert difference(*alike, f"step {step}") is None
    env.close()
    reference.close()


def test_after_an_error_all_worlds_begin_anew(vector, monkeypatch):
    vector.reset(seed=0)
    expected = vector.step(zeros(vector))[0]["tracks"].tobytes()
    vector.reset(seed=3)

    def fails(*_):
        raise MemoryError

    with monkeypatch.context() as broken:
        broken.setattr(vector._worlds.loop.motion, "advance", fails)
        with pytest.raises(MemoryError):
            vector.step(zeros(vector))
    # The worlds have fired, and have not moved.
    with pytest.raises(gymnasium.error.ResetNeeded):
        vector.step(zeros(vector))
    vector.reset(seed=0)
    assert vector.step(zeros(vector))[0]["tracks"].tobytes() == expected


@pytest.mark.parametrize(
    "broken", [lambda env: (env._worlds, "begin"), lambda env: (env, "_handed_out")]
)
def test_after_an_error_past_the_step_of_the_worlds_all_begin_anew(broken, monkeypatch):
    """All worlds have made a step whose results nobody received."""
    env = native(NAME, 2, budget=0.03, duration_s=0.2)
    env.reset(seed=0)
    env.step(zeros(env))
    env.reset(seed=[0, None], options={"reset_mask": np.array([True, False])})
    assert env.step(zeros(env))[3].tolist() == [False, True]

    def fails(*_):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(*broken(env), fails)
        with pytest.raises(MemoryError):
            env.step(zeros(env))
    env.reset(seed=[None, 7], options={"reset_mask": np.array([False, True])})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(zeros(env))
    env.close()


@pytest.mark.usefixtures("interruptible")
def test_worlds_begin_after_what_an_interrupt_left_at_work(vector, monkeypatch):
    done, seen, begin = [], [], vector._worlds.begin

    def works(_part):
        if threading.current_thread() is not threading.main_thread():
            time.sleep(0.1)
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
            time.sleep(0.3)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        vector.thread_pool.share(works, np.ones(3, np.bool_))
    monkeypatch.setattr(vector._worlds, "begin", lambda own: seen.append(bool(done)) or begin(own))
    vector.reset(seed=0)
    assert seen == [True]


def test_what_is_closed_says_so(vector):
    vector.reset(seed=0)
    vector.close()
    vector.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        vector.reset(seed=0)
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        vector.step(zeros(vector))


def test_what_many_worlds_cannot_do_is_one_line():
    env = native("CARE-CutIn-v0", 2)
    with pytest.raises(InvalidInput, match="many worlds keep their 'budget'"):
        env.set_attr("budget", 0.2)
    with pytest.raises(InvalidInput, match="many worlds draw no pictures"):
        env.render()
    env.close()
