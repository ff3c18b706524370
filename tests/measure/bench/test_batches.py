"""Many worlds and a learner, measured: what is counted, what is left out, what stays."""

import json
import sys
import threading
from concurrent.futures import Executor, Future

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_envpool
from care_sim.measure.bench import batches
from care_sim.measure.bench.batches import ENVPOOL, WORLDS, batch_memory, row
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.learning import PPO, RECIPE, learning
from care_sim.policies.learned.weights import load_weights, shipped_weights
from care_sim.training.config import PpoConfig
from care_sim.training.environments import side_by_side

TINY = BenchConfig(seconds=0.001, repeats=1, resets=1)


class Counting(gymnasium.vector.VectorEnv):
    """Two worlds, whose episodes have two steps in the one and three in the other."""

    num_envs = 2
    single_action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.steps, self.begun = 0, 1
        return np.zeros(2), {}

    def step(self, actions):
        self.steps += 1
        self.begun += self.steps == 4
        over = np.array([self.steps % 3 == 2, self.steps % 4 == 3])
        return np.zeros(2), np.zeros(2), over, np.zeros(2, bool), {}


def test_every_world_begins_another_episode_however_short_the_time(monkeypatch):
    made = Counting()
    playing = batches._Playing(made, lambda observations: observations)
    figures = batches._speed(lambda: playing, 0.0)
    assert made.steps == 4
    assert made.begun == 2
    assert figures["steps_per_s"] > 0
    assert figures["steps_per_cpu_s"] > 0


def test_rows_say_threads_and_infos():
    assert row(2) == "64 worlds, two threads"
    assert row(1, scoring_info=False) == "64 worlds, one thread, scoring_info=False"


def test_two_processes_make_what_both_make():
    figures = "steps_per_s", "steps_per_cpu_s"
    halves = iter([(3000.0, 3100.0), (4000.0, 4500.0)])

    class Pool(Executor):
        def submit(self, measured, config):
            done = Future()
            done.set_result(dict(zip(figures, next(halves), strict=True)))
            return done

    assert batches._speed_of_two(Pool(), TINY) == {"steps_per_s": 7000.0, "steps_per_cpu_s": 3800.0}


def test_what_is_not_installed_is_left_out_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "envpool", None)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    makers, (line,) = batches._makers(TINY)
    assert ENVPOOL not in makers
    assert line.startswith(f"{ENVPOOL}: EnvPool is not installed: pip install envpool")
    with pytest.raises(MissingExtra):
        import_envpool()
    figures, (line,) = learning(TINY)
    assert figures == {}
    assert line.startswith(
        f"{PPO}: ppo needs the extra 'rl': pip install -c constraints.txt -e '.[rl]'"
    )


def test_a_learner_that_is_answered_at_once_waits_for_one_step():
    pytest.importorskip("stable_baselines3")
    from care_sim.measure.bench.answered_at_once import AnsweredAtOnce

    config = PpoConfig(environments=2, env_parameters=("duration_s=0.2",))
    envs = AnsweredAtOnce(side_by_side(config))
    envs.reset()
    first, *others = (envs.step(np.zeros((2, 4, 32), np.float32)) for _ in range(5))
    assert all(answer is first for answer in others)
    # Of the real ones the second step ends the episodes.
    assert not first[2].any()
    assert envs.venv.step(np.zeros((2, 4, 32), np.float32))[2].all()
    envs.close()


@pytest.mark.slow
def test_the_worlds_of_a_batch_take_memory_and_leave_no_thread():
    before = threading.active_count()
    memory = batch_memory(TINY)
    assert memory["resets"] == WORLDS
    # Linux sums up the pages of its cores late: a peak that is told later may lack some kB of it.
    peaks = [memory[told] for told in ("begun_mb", "early_mb", "peak_mb")]
    assert 50 < peaks[0] < peaks[1] + 1 < peaks[2] + 2 < 1000
    assert memory["threads_left"] == 0
    assert threading.active_count() == before


def test_the_recipe_is_that_of_the_shipped_weights():
    told = load_weights(shipped_weights("ppo-dense")).card.result["config"]
    assert json.loads(json.dumps(RECIPE.recipe)) | told == RECIPE.recipe
    assert len(told) > 15
