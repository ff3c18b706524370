"""Vector environments as learners of Stable-Baselines3 take them: the answers of `DummyVecEnv`."""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

pytest.importorskip("stable_baselines3")
pytest.importorskip("torch")

from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import TRAINING
from care_sim.training.config import PpoConfig
from care_sim.training.environments import side_by_side, training
from care_sim.training.run import make_learner
from care_sim.training.seeds import TrainingSeeds, VectorTrainingSeeds
from care_sim.training.vec_env import GymnasiumVecEnv
from care_sim.wrappers import GridObservation, SectorReserve, VectorGridObservation

SHORT = ("duration_s=1.2", "false_negative_rate=0.1")
SAME_STEP, DISABLED = AutoresetMode.SAME_STEP, AutoresetMode.DISABLED


def vector(worlds=2, mode=SAME_STEP, **given):
    arguments = {"budget": 0.03, "duration_s": 1.0} | given
    return gymnasium.make_vec(
        "CARE-Dense-v0", worlds, "vector_entry_point", autoreset_mode=mode, **arguments
    )


def one_by_one(config):
    """The environments of a training run as they are without vectors."""
    budgets = [config.budget[world % len(config.budget)] for world in range(config.environments)]
    return VecMonitor(DummyVecEnv([partial(training, config, budget) for budget in budgets]))


def frozen(told):
    """Arrays as bytes, numbers with their types; the time that an episode took is nobody's."""
    if isinstance(told, dict):
        return {name: frozen(value) for name, value in told.items() if name != "t"}
    if isinstance(told, list | tuple) or (isinstance(told, np.ndarray) and told.dtype == object):
        return [frozen(value) for value in told]
    if isinstance(told, np.ndarray):
        return str(told.dtype), told.shape, told.tobytes()
    return type(told).__name__, told


def answers(envs, steps=28):
    """All that a learner and its callbacks could read."""
    envs.seed(5)
    told = [frozen([envs.reset(), envs.venv.reset_infos])]
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (envs.num_envs, *envs.action_space.shape))
        answer = envs.step(actions.astype(np.float32))
        told.append(frozen([*answer, envs.venv.reset_infos]))
    envs.close()
    return told


@pytest.mark.parametrize(
    "given",
    [
        {"environments": 4, "budget": (0.03, 0.1, 0.05)},
        {"environments": 2, "action": "SectorScores", "azimuths": 16, "columns": 32, "seed": 7},
    ],
    ids=["several budgets", "SectorScores"],
)
def test_it_answers_what_single_environments_answer(given):
    config = PpoConfig(env_parameters=SHORT, **given)
    expected = answers(one_by_one(config))
    assert answers(side_by_side(config)) == expected
    over = [step[2] for step in expected[1:]]
    assert len({flags for _, _, flags in over}) > 1, "some episodes end"


def test_a_learner_learns_the_same_to_the_last_bit():
    """From several budgets, with 30 steps more than the first episodes have."""
    given = {"environments": 3, "budget": (0.03, 0.1), "hidden": 4, "rollout": 40, "batch": 40}
    config = PpoConfig(**given, env_parameters=("duration_s=1.0",), steps=120)
    learned = []
    for envs in (one_by_one(config), side_by_side(config)):
        model = make_learner(config, envs)
        before = {name: weights.clone() for name, weights in model.policy.state_dict().items()}
        model.learn(config.steps)
        learned.append({name: x.numpy() for name, x in model.policy.state_dict().items()})
        assert any((before[name].numpy() != learned[-1][name]).any() for name in before)
        envs.close()
    assert frozen(learned[0]) == frozen(learned[1])


@pytest.mark.parametrize("copy", [True, False])
def test_what_was_given_stays_as_it_was(copy):
    """A learner reads the last observation after the next step."""
    envs = GymnasiumVecEnv(vector(copy=copy))
    given = [envs.reset()]
    kept = [frozen(given[0])]
    for _ in range(3):
        given.append(envs.step(np.zeros((2, 32, 512), np.float32))[0])
        kept.append(frozen(given[-1]))
    assert [frozen(one) for one in given] == kept
    envs.close()


def test_observations_may_be_one_array():
    def flat():
        env = gymnasium.make("CARE-Dense-v0", budget=0.03, duration_s=0.5)
        return gymnasium.wrappers.FlattenObservation(GridObservation(SectorReserve(env)))

    expected = answers(VecMonitor(DummyVecEnv([flat] * 2)), 12)
    envs = GymnasiumVecEnv(SyncVectorEnv([flat] * 2, autoreset_mode=SAME_STEP))
    assert answers(VecMonitor(envs), 12) == expected


def test_attributes_and_wrappers_are_those_of_the_vector():
    pictures = VectorGridObservation(vector(budget=0.03))
    envs, own = GymnasiumVecEnv(pictures), GymnasiumVecEnv(vector(budget=[0.1, 0.03]))
    assert [rig.budget for rig in own.get_attr("rig")] == [1638, 492]
    assert [rig.budget for rig in own.get_attr("rig", [1])] == [492]
    assert envs.get_attr("features", 0)[0] is pictures.features
    assert not envs.has_attr("wheels")
    own.set_attr("mark", 5)
    assert own.get_attr("mark") == [5, 5]
    with pytest.raises(InvalidInput, match="mark is one for all worlds"):
        envs.set_attr("mark", 3, [0])
    assert envs.env_is_wrapped(GridObservation) == [True] * 2
    assert envs.env_is_wrapped(VectorGridObservation, [1]) == [True]
    assert envs.env_is_wrapped(Monitor) == [False] * 2
    with pytest.raises(InvalidInput, match="reset cannot be called for one world"):
        envs.env_method("reset", indices=0)
    normal = VecNormalize(envs, norm_obs=False)
    normal.seed(0)
    normal.reset()
    envs.close()
    own.close()


def test_what_no_learner_can_take_is_refused_in_one_line():
    for given, message in (
        (gymnasium.make("CARE-Dense-v0"), "a vector environment of Gymnasium is needed"),
        (vector(mode=AutoresetMode.NEXT_STEP), "must be SameStep .*, got NextStep"),
    ):
        with pytest.raises(InvalidInput, match=message):
            GymnasiumVecEnv(given)
        given.close()
    envs = GymnasiumVecEnv(vector())
    envs.set_options({"weather": "rain"})
    with pytest.raises(InvalidInput, match="reset takes no options"):
        envs.reset()
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step_wait()
    envs.close()


def told_of(envs, steps=25):
    nothing = np.zeros(envs.action_space.shape, np.float32)
    begun = frozen(envs.reset(seed=3))
    told = [frozen(envs.step(nothing)) for _ in range(steps)]
    again = frozen(envs.reset())
    envs.close()
    return [begun, *told, again]


@pytest.mark.parametrize("copy", [True, False])
def test_training_seeds_of_a_vector_are_those_of_its_worlds(copy):
    def make():
        return TrainingSeeds(gymnasium.make("CARE-Dense-v0", budget=0.03, duration_s=1.0), 4)

    expected = told_of(SyncVectorEnv([make] * 3, autoreset_mode=SAME_STEP))
    made = VectorTrainingSeeds(vector(3, DISABLED, copy=copy), 4)
    assert made.metadata["autoreset_mode"] == SAME_STEP
    assert told_of(made) == expected


def test_training_seeds_begin_episodes_themselves():
    envs = vector(2)
    with pytest.raises(InvalidInput, match="autoreset_mode must be Disabled"):
        VectorTrainingSeeds(envs)
    envs.close()
    envs = VectorTrainingSeeds(vector(2, DISABLED))
    assert envs.reset(seed=[1, None])[1]["seed"].min() >= TRAINING
    with pytest.raises(InvalidInput, match="reset takes no options"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(InvalidInput, match="seed must be one for each of 2, got 3"):
        envs.reset(seed=[1, 2, 3])
    envs.close()
